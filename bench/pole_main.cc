// engram-pole: Talos reaches around the pole, in lock step in this process; one row per motion on standard output.
//
//   engram-pole motions=20 seed=1 memory=memory|shift|cold [first=N] [cycles=FILE] [guide=1] [record=FILE]
//
// A motion: the hand is brought to a random point on one side of the pole by a guide that plans the way (`PoleGuide`; led 0: it found none),
// then the target goes to a random point on the other side, at once or along a straight line at up to kSpeed, and the controller is on its
// own for kAlone seconds.
// nearest_mm, nearest_s: the smallest clearance of the arm from the pole in the second part, and when; tilt_mrad: most of the base.
// Success: the robot stands, the arm never touched the pole, and the hand is within the task's success_position over the last kRest seconds.
// With `guide=1` the guide leads in both parts, after up to kStray seconds in which the hand may get stuck: the runs from which the memory
// learns. record=FILE: one row of doubles per control period of the second part of a motion that succeeds (native byte order): motion,
// s since the guide took over, q, v, target (see codegen/engram/learn/pole.py).
// first=N: motions N, N + 1, ... of the seed's; cycles=FILE: two doubles per control period of the second part, CPU time of the whole and
// of the memory's answer [us].
// witness=table|random: every answer that takes the shifted plan's place is rolled out beside it (pole_witness.h); `random`: the memory is
// random numbers. queries=edge: targets at the edge of the task's domain; outside: the robot is pushed about, into states unknown to the memory.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "bench/modes.h"
#include "bench/pole_guided.h"
#include "bench/pole_witness.h"
#include "bench/stopwatch.h"
#include "codegen/offline/pole_guide.h"
#include "tests/support/legged_plant.h"

namespace {

using engram::PoleGuide;
using engram::RrtResult;
using engram::uniform;
using engram::test::LeggedController;
using engram::test::LeggedPlant;
using Task = engram::tasks::TalosPole;

constexpr double kSettle = 4.0, kAlone = 4.0, kRest = 0.3;  // s, most time to get to the first point; s; s
constexpr double kSpeed = 0.8;                              // m/s, slowest of a target that moves half of it
constexpr double kPush = 40.0;                              // N, largest on the elbow, each way; a new one every 0.2 s
constexpr double kStray = 1.2;                              // s, longest that a guided hand goes on its own before the guide leads

struct Motion {
  double from[3], to[3];  // m, world
  double speed;           // m/s; 0: the target jumps
  int64_t stray;          // us, of a guided run: so long the hand goes on its own first, and may get stuck
};

// A point on one side of the pole: left 1, right -1. Out of the pole's way and within reach.
void draw(std::mt19937_64& rng, int side, double (&p)[3]) {
  p[0] = uniform(rng, 0.32, 0.45);
  p[1] = Task::p_WO[0][1] + side * (side > 0 ? uniform(rng, 0.16, 0.32) : uniform(rng, 0.16, 0.28));
  p[2] = uniform(rng, 0.95, 1.2);
}

Motion draw(std::mt19937_64& rng, std::mt19937_64& astray) {
  Motion m;
  const int side = rng() & 1 ? 1 : -1;
  draw(rng, side, m.from);
  draw(rng, -side, m.to);
  m.speed = rng() & 1 ? uniform(rng, 0.5 * kSpeed, kSpeed) : 0.0;
  m.stray = 10000 * std::max(int64_t{0}, static_cast<int64_t>(100.0 * uniform(astray, -0.5 * kStray, kStray)));  // whole ticks
  return m;
}

double distance(const double* a, const double* b) { return std::sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2])); }

// How far the joint that is farthest beyond its limits is [rad].
double excess(const LeggedPlant& plant) {
  double most = 0.0;
  for (int j = 0; j < plant.model()->njnt; ++j) {
    if (!plant.model()->jnt_limited[j]) continue;
    const double q = plant.data()->qpos[plant.model()->jnt_qposadr[j]];
    most = std::max({most, plant.model()->jnt_range[2 * j] - q, q - plant.model()->jnt_range[2 * j + 1]});
  }
  return most;
}

bool touches(const LeggedPlant& plant, int pole) {
  for (int i = 0; i < plant.data()->ncon; ++i) {
    const mjContact& c = plant.data()->contact[i];
    if ((c.geom1 == pole || c.geom2 == pole) && c.dist <= 0.0) return true;
  }
  return false;
}

// From the sphere of the arm that is nearest to the pole to it [m].
double clearance(const LeggedPlant& plant) {
  double least = HUGE_VAL;
  for (int g = 0; g < plant.model()->ngeom; ++g) {
    const char* const name = mj_id2name(plant.model(), mjOBJ_GEOM, g);
    if (name == nullptr || std::strncmp(name, "sphere_", 7) != 0) continue;
    const double* const p = plant.data()->geom_xpos + 3 * g;
    engram::Vec3<double> gradient;
    const double to_centre = engram::TalosPole::Field::distance(0, engram::Vec3<double>(p[0], p[1], p[2]), gradient);
    least = std::min(least, to_centre - plant.model()->geom_size[3 * g]);
  }
  return least;
}

}  // namespace

int main(int argc, char** argv) {
  int motions = 20, first = 0;
  uint64_t seed = 1;
  bool guided = false;
  std::string memory = "memory", record, times, witness, queries_of = "inside";
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i], key = text.substr(0, text.find('=')), value = text.substr(std::min(text.size(), key.size() + 1));
    if (key == "motions") motions = std::atoi(value.c_str());
    else if (key == "seed") seed = std::strtoull(value.c_str(), nullptr, 0);
    else if (key == "memory") memory = value;
    else if (key == "first") first = std::atoi(value.c_str());
    else if (key == "cycles") times = value;
    else if (key == "guide") guided = value == "1";
    else if (key == "record") record = value;
    else if (key == "witness") witness = value;
    else if (key == "queries") queries_of = value;
    else bench::fail("usage: engram-pole [motions=N] [seed=S] [memory=memory|shift|cold] [first=I] [cycles=FILE] [guide=1] [record=FILE] [witness=table|random] [queries=inside|edge|outside]");
  }
  const engram_model* const kModel = guided ? &engram_talos_pole_guided : witness.empty() ? &engram_talos_pole : &engram_talos_pole_witness;
  if (witness == "random") pole_random_tables();
  engram_options options;
  engram_default_options(kModel, &options);
  options.clock = bench::thread_us;
  options.memory = bench::mode_of(memory);
  const auto open = [](const std::string& path) -> std::FILE* {
    std::FILE* const file = path.empty() ? nullptr : std::fopen(path.c_str(), "wb");
    if (!path.empty() && file == nullptr) bench::fail("engram-pole: cannot write " + path);
    return file;
  };
  std::FILE *const log = open(record), *const clocked = open(times);

  std::mt19937_64 rng(seed), astray(~seed);
  std::vector<double> cycles, queries;
  const auto guide = std::make_unique<PoleGuide>();
  int successes = 0, done = 0;
  for (int n = 0; n < first + motions; ++n) {
    Motion m = draw(rng, astray);
    if (n < first) continue;
    if (queries_of == "edge") {
      const int axis = n % 3;
      m.to[axis] = n / 3 % 2 ? Task::task_lo[axis] : Task::task_hi[axis];
      m.speed = 0.0;
    }
    std::mt19937_64 pushes(seed ^ static_cast<uint64_t>(n));
    LeggedPlant plant(kModel, 0.0);
    LeggedController controller(kModel, &options);
    if (controller.error != ENGRAM_NO_ERROR) bench::fail(engram_error_text(controller.error));
    const int pole = mj_name2id(plant.model(), mjOBJ_GEOM, "pole"), site = mj_name2id(plant.model(), mjOBJ_SITE, "right_gripper");
    const double* const hand = plant.data()->site_xpos + 3 * site;
    int32_t jump = 0;
    bool touched = false, fallen = false;
    int refused = 0;
    const auto ask = [&](const double* p, bool fresh) {
      jump += fresh ? 1 : 0;
      if (engram_set_task(controller.handle, plant.utime, jump, p, 3) == ENGRAM_BAD_TASK) ++refused;
    };
    const auto step = [&] {
      controller.step(plant);
      fallen = fallen || !(plant.base_up() > 0.8);
    };
    // to the first point
    const auto lead = [&](bool fresh) {
      double p[3];
      guide->lead(hand, p);
      ask(p, fresh);
    };
    bool led = guide->begin(plant.q.data(), m.from, seed + static_cast<uint64_t>(n)) == RrtResult::kFound;
    int still = 0;
    const auto settled = [&] { return still >= 300 && plant.utime % 10000 == 0; };  // the second part begins at a tick
    while (plant.utime < static_cast<int64_t>(1e6 * kSettle) && !settled() && !fallen) {
      if (plant.utime % 10000 == 0) lead(plant.utime == 0);
      step();
      still = distance(hand, m.from) < Task::success_position ? still + 1 : 0;
    }
    const bool ready = settled();
    // on its own
    const double way = distance(m.from, m.to);
    const auto target = [&](double t, double (&p)[3]) {  // t seconds after it set out
      const double s = m.speed == 0.0 ? 1.0 : std::min(1.0, t * m.speed / way);
      for (int i = 0; i < 3; ++i) p[i] = m.from[i] + s * (m.to[i] - m.from[i]);
    };
    double p[3];
    for (int64_t begin = plant.utime; guided && ready && plant.utime < begin + m.stray && !fallen; step()) {
      target(1e-6 * static_cast<double>(plant.utime - begin), p);
      if (plant.utime % 10000 == 0) ask(p, plant.utime == begin);
    }
    if (guided && ready && !fallen) led = guide->begin(plant.q.data(), m.to, seed + static_cast<uint64_t>(n)) == RrtResult::kFound && led;
    const int64_t start = plant.utime;
    std::vector<double> rows;
    double worst = 0.0, over = 0.0, nearest = HUGE_VAL, nearest_at = 0.0, tilt = 0.0;  // m, rad, m, s, rad
    int remembered = 0, asked = 0, worse = 0;  // cycles that the memory has won; answered; won though it costs no less than the shifted plan
    while (ready && plant.utime < start + static_cast<int64_t>(1e6 * kAlone) && !fallen) {
      const double t = 1e-6 * static_cast<double>(plant.utime - start);
      if (plant.utime % 10000 == 0) {
        if (guided) {
          lead(t == 0.0);
        } else {
          target(t, p);
          if (t == 0.0 || m.speed > 0.0) ask(p, t == 0.0);  // those within the pole are refused: the last one stays
        }
        rows.insert(rows.end(), {double(n), t});
        rows.insert(rows.end(), plant.q.begin(), plant.q.end());
        rows.insert(rows.end(), plant.v.begin(), plant.v.end());
        rows.insert(rows.end(), m.to, m.to + 3);
      }
      if (queries_of == "outside" && plant.utime % 200000 == 0) {
        const double force[3] = {uniform(pushes, -kPush, kPush), uniform(pushes, -kPush, kPush), 0.0};
        plant.push("arm_right_4_joint", force);
      }
      const bool ticked = plant.utime % 10000 == 0;
      step();
      if (ticked) {
        cycles.push_back(controller.cycle().total_us);
        const engram_cycle& c = controller.cycle();
        remembered += c.winner == ENGRAM_CANDIDATE_KNN;
        asked += c.nguess == 2;
        worse += c.winner == ENGRAM_CANDIDATE_KNN && !(c.merit[1] <= c.merit[0]);
        queries.push_back(controller.cycle().asked_us[ENGRAM_CANDIDATE_KNN]);
        const double row[2] = {cycles.back(), queries.back()};
        if (clocked != nullptr) std::fwrite(row, sizeof row, 1, clocked);
      }
      touched = touched || touches(plant, pole);
      if (const double now = clearance(plant); now < nearest) nearest = now, nearest_at = t;
      over = std::max(over, excess(plant));
      tilt = std::max(tilt, std::acos(std::min(1.0, plant.base_up())));
      if (t > kAlone - kRest) worst = std::max(worst, distance(hand, m.to));
    }
    const bool success = ready && !fallen && !touched && worst < Task::success_position;
    if (success && log != nullptr) std::fwrite(rows.data(), sizeof(double), rows.size(), log);
    successes += success ? 1 : 0;
    ++done;
    std::printf("motion %d side %d speed %.2f ready %d success %d led %d error_m %.4f touched %d nearest_mm %.1f nearest_s %.2f over_mrad %.2f tilt_mrad %.0f fallen %d refused %d remembered %d asked %d worse %d hand %.3f %.3f %.3f\n", n,
                m.to[1] > Task::p_WO[0][1] ? 1 : -1, m.speed, ready, success, led, worst, touched, 1e3 * nearest, nearest_at, 1e3 * over, 1e3 * tilt, fallen, refused, remembered, asked, worse, hand[0], hand[1], hand[2]);
    std::fflush(stdout);
  }
  if (log != nullptr) std::fclose(log);
  if (clocked != nullptr) std::fclose(clocked);
  const auto share = [](std::vector<double>& us, double s) {
    std::sort(us.begin(), us.end());
    return us.empty() ? 0.0 : us[std::min(us.size() - 1, static_cast<size_t>(s * static_cast<double>(us.size())))];
  };
  std::printf("total motions %d successes %d cycles %zu p50_us %.0f p99_us %.0f max_us %.0f query_p50_us %.1f query_p99_us %.1f\n", done, successes,
              cycles.size(), share(cycles, 0.5), share(cycles, 0.99), share(cycles, 1.0), share(queries, 0.5), share(queries, 0.99));
  const PoleWitness& w = pole_witness();
  if (!witness.empty()) std::printf("witness asked %ld accepted %ld above %ld worst %.4f\n", w.asked, w.accepted, w.above, w.worst);
  return 0;
}
