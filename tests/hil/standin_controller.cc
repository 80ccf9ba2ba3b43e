// A stand-in for engram-controller, so that the harness can be tested by itself: Cartesian impedance control from MuJoCo's own
// model.
//
//   tau = bias(q, v) + J' (kp e - kd V) - d v
//
// It knows no obstacles and plans nothing: it reaches what a straight line of the hand reaches. It answers a repeated state with
// the same command, as the real one does.
#include <lcm/lcm.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <vector>

#include "sim_harness/sim_link.h"
#include "sim_harness/sim_model.h"
#include "sim_harness/sim_options.h"

namespace {

using namespace engram::sim;

volatile std::sig_atomic_t stop = 0;

struct StandIn {
  Model model;
  lcm_t* lcm = nullptr;
  int64_t seq = 0;
  bool has_task = false;
  engram_msg_task_t task{};
  engram_msg_command_t command{};
  int cycle_count = 0, die_after = 0, misbehave = 0;

  void control(const engram_msg_state_t& state) {
    model.set_state(state.q, state.v);
    mj_fwdPosition(model.m, model.d);
    mj_fwdVelocity(model.m, model.d);
    const int nv = model.nv, first = nv - model.nu;
    std::vector<double> force(model.d->qfrc_bias, model.d->qfrc_bias + nv);
    for (int i = 0; i < nv; ++i) force[i] -= 1.0 * model.d->qvel[i];
    if (has_task && model.hand_site >= 0) {
      std::vector<double> jacobian(6 * nv);
      mj_jacSite(model.m, model.d, jacobian.data(), jacobian.data() + 3 * nv, model.hand_site);
      double twist[6], wrench[6], hand[4], target[4], rotation[3];
      mju_mulMatVec(twist, jacobian.data(), model.d->qvel, 6, nv);
      const Pose pose = model.hand_pose();
      const double to_wxyz[8] = {pose.quat[3],  pose.quat[0],  pose.quat[1],  pose.quat[2],
                                 task.value[6], task.value[3], task.value[4], task.value[5]};
      mju_copy4(hand, to_wxyz), mju_copy4(target, to_wxyz + 4);
      mju_subQuat(rotation, target, hand);  // in hand axes
      mju_rotVecQuat(rotation, rotation, hand);
      for (int i = 0; i < 3; ++i) {
        wrench[i] = std::clamp(600.0 * (task.value[i] - pose.p[i]), -60.0, 60.0) - 60.0 * twist[i];
        wrench[3 + i] = std::clamp(60.0 * rotation[i], -20.0, 20.0) - 6.0 * twist[3 + i];
      }
      std::vector<double> push(nv);
      mju_mulMatTVec(push.data(), jacobian.data(), wrench, 6, nv);
      for (int i = 0; i < nv; ++i) force[i] += push[i];
    }
    for (int i = 0; i < model.nu; ++i) {
      const double* range = model.m->actuator_ctrlrange + 2 * i;
      command.tau[i] = model.m->actuator_ctrllimited[i] ? std::clamp(force[first + i], range[0], range[1]) : force[first + i];
    }
    if (misbehave == 1) command.tau[0] = 0.0 / 0.0;
    if (misbehave == 3) command.tau[0] = 1e9;
    command.utime = state.utime, command.seq = state.seq, command.robot_digest = state.robot_digest, command.nu = model.nu;
    if (misbehave == 2) ++command.robot_digest;
  }

  void publish_cycle(const engram_msg_state_t& state) {
    engram_msg_cycle_t cycle{};
    cycle.utime = state.utime, cycle.seq = ++cycle_count, cycle.jump = task.jump;
    cycle.ncandidates = 1, cycle.npath = 2;
    const Pose pose = model.hand_pose();
    for (int i = 0; i < 3; ++i) cycle.path[0][i] = pose.p[i], cycle.path[1][i] = has_task ? task.value[i] : pose.p[i];
    engram_msg_cycle_t_publish(lcm, kCycleChannel, &cycle);
  }

  static void on_state(const lcm_recv_buf_t* buf, const char*, void* self) {
    StandIn& me = *static_cast<StandIn*>(self);
    engram_msg_state_t state;
    if (engram_msg_state_t_decode(buf->data, 0, static_cast<int>(buf->data_size), &state) < 0) return;
    if (state.seq != me.seq || state.utime != me.command.utime) {
      if (state.seq == 1) me.has_task = false;
      me.seq = state.seq;
      if (me.die_after > 0 && state.utime >= 1000 * int64_t{me.die_after}) std::raise(SIGKILL);
      me.control(state);
      if ((state.seq - 1) % 10 == 0) me.publish_cycle(state);
    }
    engram_msg_command_t_publish(me.lcm, kCommandChannel, &me.command);
    engram_msg_timing_t timing{};
    timing.utime = state.utime, timing.seq = me.cycle_count;
    if ((state.seq - 1) % 10 == 0) engram_msg_timing_t_publish(me.lcm, kTimingChannel, &timing);
  }

  static void on_task(const lcm_recv_buf_t* buf, const char*, void* self) {
    StandIn& me = *static_cast<StandIn*>(self);
    me.has_task = engram_msg_task_t_decode(buf->data, 0, static_cast<int>(buf->data_size), &me.task) > 0;
  }
};

}  // namespace

int main(int argc, char** argv) {
  StandIn standin;
  std::string scene, url, hand = "hand_tcp", unused;
  parse_options(argc, argv, "engram-standin: a simple controller to test the harness with",
                {{"--scene", "FILE", "MJCF of robot and world", &scene},
                 {"--hand", "SITE", "site to steer; default hand_tcp", &hand},
                 {"--lcm-url", "URL", "LCM provider", &url},
                 {"--die-after-ms", "MS", "kill itself at this plant time", &standin.die_after},
                 {"--misbehave", "KIND", "1: a torque that is not finite; 2: another robot's digest; 3: an absurd torque",
                  &standin.misbehave},
                 {"--clock", "CLOCK", "accepted, as by the real one", &unused},
                 {"--memory", "MODE", "accepted", &unused},
                 {"--jumps", "FILE", "accepted", &unused}});
  install_mujoco_handlers("engram-standin");
  const std::string wrong = standin.model.load(scene.c_str());
  if (!wrong.empty()) return std::fprintf(stderr, "engram-standin: %s\n", wrong.c_str()), 2;
  standin.model.select_hand(hand.c_str());
  standin.lcm = lcm_create(url.c_str());
  if (!standin.lcm) return 2;
  std::signal(SIGTERM, [](int) { stop = 1; });
  std::signal(SIGINT, [](int) { stop = 1; });
  lcm_subscribe(standin.lcm, kStateChannel, StandIn::on_state, &standin);
  lcm_subscribe(standin.lcm, kTaskChannel, StandIn::on_task, &standin);
  while (!stop) lcm_handle_timeout(standin.lcm, 100);
  lcm_destroy(standin.lcm);
  return 0;
}
