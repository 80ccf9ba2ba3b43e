// Talos reaches around a pole: the terms of the hand, and of what keeps it clear. docs/pole.md
#ifndef CONTROLLER_LOOP_LOOP_TALOS_POLE_H_
#define CONTROLLER_LOOP_LOOP_TALOS_POLE_H_

#include "controller/loop/loop_pole_memory.h"
#include "controller/loop/loop_talos.h"
#include "controller/ocp/ocp_frame_reach.h"
#include "controller/ocp/ocp_obstacles.h"
#include "tables/talos_pole/task.h"

namespace engram {

// Stands on both feet; the right hand goes to p_WT, the arm stays clear of the boxes of world.xml.
struct TalosPole : TalosBody<tasks::TalosPole, 40> {
  static constexpr bool kReaches = true;
  static constexpr int kHand = Robot::kRightGripper;
  using Field = BoxField<Task>;
  using P = ContactOcp<Soles, StateTerm<Robot>, TorqueTerm<Robot>, LimitTerm<Robot>, ComTerm<Robot>, Swing<0>, Swing<1>, Cone<0>, Cone<1>,
                       FrameReachTerm<Robot, kHand>, ObstacleTerm<Robot, Field, Task>>;
  using Gait = TalosStand::Gait;

  static void command(const double* task, LeggedCommand& c) { std::memcpy(c.hand, task, sizeof c.hand); }

  // A hand does not fit where an obstacle is.
  static bool reachable(const LeggedCommand& c) {
    Vec3<double> g;
    for (int i = 0; i < Field::count; ++i)
      if (!(Field::distance(i, Vec3<double>(c.hand[0], c.hand[1], c.hand[2]), g) >= Task::reach_clearance)) return false;
    return true;
  }
  template <class Knot> static void reach(Knot& k, double weight, const LeggedCommand& c, bool terminal) {
    k.reach_w = weight * Task::reach_hand * (terminal ? Task::reach_terminal : 1.0);
    k.reach_near = Task::reach_near;
    std::memcpy(k.reach_p, c.hand, sizeof c.hand);
    k.limit_w_v = weight * Task::reach_limit_v;
    k.limit_w_u = terminal ? 0.0 : weight * Task::reach_limit_u;
    k.obstacle_w = weight * Task::reach_obstacle;
    k.obstacle_margin = Task::reach_margin;
    k.limit_margin_q = Task::reach_limit_margin;
  }
  // Where the hand is [m]: world axes.
  static Vec3<double> hand_of(const RbdData<Robot, double>& d) {
    Mat3<double> R_WF;
    Vec3<double> p;
    rbd_frame_placement<Robot>(d, kHand, R_WF, p);
    return p;
  }
  static void hand(const double* x, double (&p)[3]) {
    RbdData<Robot, double> d;
    rbd_kinematics<Robot>(x, d);
    const Vec3<double> at = hand_of(d);
    for (int i = 0; i < 3; ++i) p[i] = at[i];
  }
  // Where hand and elbow are [m], and how the hand moves [m/s]: world axes.
  static void arm(const double* x, double* p_WH, double* p_WE, double* v_WH) {
    RbdData<Robot, double> d;
    rbd_kinematics<Robot>(x, d);
    rbd_velocity<Robot>(x + Robot::nq, d);
    const Vec3<double> at = hand_of(d), moves = rbd_point_velocity<Robot>(d, Robot::frame_joint[kHand], at);
    for (int i = 0; i < 3; ++i) {
      p_WH[i] = at[i];
      p_WE[i] = d.p_WJ[1 + moved[kElbow]][i];
      v_WH[i] = moves[i];
    }
  }

  // What the memory moves: driven dofs of the torso and of the right arm.
  static constexpr int nmoved = 9, moved[nmoved] = {12, 13, 22, 23, 24, 25, 26, 27, 28};
  static constexpr int kElbow = 5;  // of them
};

// The same with a memory.
template <const PoleTables& tables> struct TalosPoleRemembers : TalosPole {
  using Memory = PoleMemory<TalosPole, P, tables>;
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_TALOS_POLE_H_
