// engram-trial: one closed loop of a robot on legs, in lock step in this process; its time series on standard output.
//
//   engram-trial <robot>_<task> seconds=10 heading=90 task=0.1:0,0.2,0.5 push=3.0:20,0
//
// heading [deg] of the robot at the start; task=<s>:<task vector>; push=<s>:<N s forward>,<N s left> over 0.1 s at the torso or base, in the
// axes of the start's heading. Tasks and pushes may be repeated. Ends early if the robot falls.
//
// What the controller is not told: load=<kg> at the torso or base; friction=<mu> of the ground; delay=<s> from a command to its effect
// (it is told of told=<s>); uneven=<m>: every touch-down is so much early or late, in turn for each foot (its ground is level, or raised by so much).
//
// memory=memory|shift|cold: what seeds the solver; random: a memory of random numbers, of talos_walk.
//
//   engram-trial <robot>_<task> limits       capture-point limits of pushes forward, back, left, right without a step [N s]
//
// Output: one row of kColumns doubles per control period (native byte order), see `Row`.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "bench/modes.h"
#include "tests/support/legged_plant.h"
#include "tests/support/random_walk.h"

namespace {

using engram::test::LeggedController;
using engram::test::LeggedPlant;

constexpr double kPushSeconds = 0.1;

struct Model {
  const engram_model* model;
  const char* pushed;  // body
  std::vector<const char*> feet;
};
const Model kModels[] = {
    {&engram_talos_stand, "torso_2_joint", {"left_sole", "right_sole"}},
    {&engram_talos_walk, "torso_2_joint", {"left_sole", "right_sole"}},
    {&engram_anymal_trot, "root_joint", {"lf_foot", "rf_foot", "lh_foot", "rh_foot"}},
};

struct Row {
  double time, com[3], com_velocity[3];  // s, m, m/s
  double up, yaw;                        // cosine of the base's tilt, heading [rad]
  double slip;                           // m, farthest horizontal distance of a foot from where it was at the start
  double torque;                         // largest |tau| / limit since the last row
  double status, rung, cost;
  double swing, com_wanted[3];           // feet asked to be in the air, bit f for foot f; m
  double foot[4][4], foothold[4][4];     // where feet are, and where they are asked to stand or land: x, y, z [m], heading [rad]
  double gap;                            // that the plan's knots leave open, L1
  double guesses, merit_shifted, merit;  // compared in this period, merit of the shifted plan and of the one that was taken
  double pose_us, linearize_us, backward_us, rollout_us, total_us;  // CPU time of the period
};
static_assert(sizeof(Row) == 59 * sizeof(double), "the reader counts on it (codegen/engram/prove/trial.py)");

struct Event {
  double at;
  std::vector<double> values;
};
Event event(const char* text) {
  char* end = nullptr;
  Event e{std::strtod(text, &end), {}};
  while (*end == ':' || *end == ',') e.values.push_back(std::strtod(end + 1, &end));
  return e;
}

// Ground that changes under a foot in the air.
struct Ground {
  bool raised = false, changed = false;
};
constexpr double kInTheAir = 0.03, kOnGround = 0.015;  // m, of a sole's centre

const Model* find(const std::string& name) {
  for (const Model& m : kModels) {
    const engram_description& about = *engram_describe(m.model);
    if (name == std::string(about.robot) + "_" + about.task) return &m;
  }
  return nullptr;
}

// The impulse at the height of the centre of mass that moves the capture point from rest to the edge of the feet: m w d, w^2 = g / z.
double capture_limit(const LeggedPlant& plant, const std::vector<const char*>& feet, double x, double y) {
  const mjModel* const m = plant.model();
  double edge = 0.0;  // m, beyond the centre of mass
  for (const char* name : feet) {
    const int g = mj_name2id(m, mjOBJ_GEOM, name);
    const mjtNum *const p = plant.data()->geom_xpos + 3 * g, *const R = plant.data()->geom_xmat + 9 * g, *const half = m->geom_size + 3 * g;
    double reach = x * (p[0] - plant.com[0]) + y * (p[1] - plant.com[1]);
    for (int i = 0; m->geom_type[g] == mjGEOM_BOX && i < 3; ++i) reach += std::fabs(x * R[i] + y * R[3 + i]) * half[i];
    edge = std::max(edge, reach);
  }
  return mj_getTotalmass(m) * std::sqrt(-m->opt.gravity[2] / plant.com[2]) * edge;
}

}  // namespace

int main(int argc, char** argv) {
  const Model* const chosen = argc > 1 ? find(argv[1]) : nullptr;
  if (chosen == nullptr) bench::fail("usage: engram-trial talos_stand|talos_walk|anymal_trot [seconds=S] [heading=DEG] [task=S:V,...] [push=S:X,Y]");
  if (argc == 3 && std::strcmp(argv[2], "limits") == 0) {
    const LeggedPlant plant(chosen->model, 0.0);
    constexpr double kWays[4][2] = {{1.0, 0.0}, {-1.0, 0.0}, {0.0, 1.0}, {0.0, -1.0}};
    for (const auto& way : kWays)
      std::printf("%.17g\n", capture_limit(plant, chosen->feet, way[0], way[1]));
    return 0;
  }
  std::string memory = "memory";
  double seconds = 5.0, heading = 0.0, load = 0.0, friction = 0.0, delay = 0.0, told = 0.0, uneven = 0.0;
  std::vector<Event> tasks, pushes;
  for (int i = 2; i < argc; ++i) {
    const std::string text = argv[i], key = text.substr(0, text.find('='));
    const char* const value = argv[i] + key.size() + 1;
    if (key == "seconds") seconds = std::atof(value);
    else if (key == "memory") memory = value;
    else if (key == "heading") heading = std::atof(value) * M_PI / 180.0;
    else if (key == "task") tasks.push_back(event(value));
    else if (key == "load") load = std::atof(value);
    else if (key == "friction") friction = std::atof(value);
    else if (key == "delay") delay = std::atof(value);
    else if (key == "told") told = std::atof(value);
    else if (key == "uneven") uneven = std::atof(value);
    else if (key == "push") pushes.push_back(event(value));
    else bench::fail("engram-trial: unknown argument " + text);
  }

  if (memory == "random" && chosen->model != &engram_talos_walk) bench::fail("engram-trial: memory=random is for talos_walk alone");
  const engram_model* const model = memory == "random" ? engram::test::random_walk() : chosen->model;
  engram_options options;
  engram_default_options(model, &options);
  options.clock = bench::thread_us;
  if (memory != "random") options.memory = bench::mode_of(memory);
  options.delay_us = static_cast<int64_t>(1e6 * told + 0.5);
  LeggedPlant plant(model, heading);
  if (load > 0.0) plant.add_mass(chosen->pushed, load);
  if (friction > 0.0) plant.friction(friction);
  plant.delay(static_cast<int>(1e6 * delay / LeggedPlant::kStepUs + 0.5));
  std::vector<Ground> grounds(chosen->feet.size());
  for (size_t f = 1; f < grounds.size(); f += 2) grounds[f].raised = true;  // feet are not raised at the same time
  LeggedController controller(model, &options);
  if (controller.error != ENGRAM_NO_ERROR) bench::fail(engram_error_text(controller.error));
  const int64_t tick = engram_describe(model)->tick_us;
  const auto foot = [&](size_t f) { return plant.data()->geom_xpos + 3 * mj_name2id(plant.model(), mjOBJ_GEOM, chosen->feet[f]); };
  std::vector<double> start;
  for (size_t f = 0; f < chosen->feet.size(); ++f) start.insert(start.end(), foot(f), foot(f) + 2);

  const auto at = [&](double s) { return plant.utime == static_cast<int64_t>(1e3 * s + 0.5) * 1000; };
  double torque = 0.0;
  int32_t jump = 0;
  while (plant.utime < static_cast<int64_t>(1e6 * seconds)) {
    for (const Event& t : tasks) {
      if (!at(t.at)) continue;
      const engram_status status =
          engram_set_task(controller.handle, plant.utime, ++jump, t.values.data(), static_cast<int32_t>(t.values.size()));
      if (status != ENGRAM_CONVERGED) bench::fail(std::string("engram-trial: task refused: ") + engram_status_text(status) +
                    ": numbers, units and ranges of a task vector are in models/<robot>/<task>/task.toml");
    }
    for (const Event& p : pushes) {
      const double x = p.values.at(0) / kPushSeconds, y = p.values.at(1) / kPushSeconds, c = std::cos(heading), s = std::sin(heading);
      if (at(p.at)) plant.push(chosen->pushed, {c * x - s * y, s * x + c * y, 0.0});
      if (at(p.at + kPushSeconds)) plant.push(chosen->pushed, {0.0, 0.0, 0.0});
    }
    for (size_t f = 0; uneven != 0.0 && f < grounds.size(); ++f) {
      Ground& g = grounds[f];
      const double height = foot(f)[2];
      if (height < kOnGround) g.changed = false;
      if (height < kInTheAir || g.changed) continue;
      g.changed = true;
      g.raised = !g.raised;
      plant.raise_ground(chosen->feet[f], g.raised ? uneven : 0.0);
    }
    const bool ticked = plant.utime % tick == 0;
    controller.step(plant);
    for (size_t i = 0; i < controller.tau.size(); ++i)
      torque = std::max(torque, std::fabs(controller.tau[i]) / plant.model()->actuator_ctrlrange[2 * i + 1]);
    if (!ticked) continue;
    const engram_cycle& c = controller.cycle();
    Row row = {};
    row.time = 1e-6 * static_cast<double>(plant.utime), row.up = plant.base_up(), row.yaw = plant.yaw(), row.torque = torque;
    row.status = c.status, row.rung = c.rung, row.cost = c.cost, row.swing = c.legs.swing;
    row.pose_us = c.query_us, row.linearize_us = c.linearize_us, row.backward_us = c.backward_us, row.rollout_us = c.rollout_us;
    row.total_us = c.total_us;
    row.gap = c.gap, row.guesses = c.nguess, row.merit_shifted = c.merit[0], row.merit = *std::min_element(c.merit, c.merit + std::max(1, c.nguess));
    std::memcpy(row.com, plant.com, sizeof row.com);
    std::memcpy(row.com_velocity, plant.com_velocity, sizeof row.com_velocity);
    std::memcpy(row.com_wanted, c.legs.com, sizeof row.com_wanted);
    std::memcpy(row.foothold, c.legs.foot, sizeof row.foothold);
    for (size_t f = 0; f < chosen->feet.size(); ++f) {
      row.slip = std::max(row.slip, std::hypot(foot(f)[0] - start[2 * f], foot(f)[1] - start[2 * f + 1]));
      const mjtNum* const R = plant.data()->geom_xmat + 9 * mj_name2id(plant.model(), mjOBJ_GEOM, chosen->feet[f]);
      std::memcpy(row.foot[f], foot(f), 3 * sizeof(double));
      row.foot[f][3] = std::atan2(R[3], R[0]);
    }
    torque = 0.0;
    std::fwrite(&row, sizeof row, 1, stdout);
    if (!(row.up > 0.7)) break;  // fallen
  }
  return 0;
}
