// Postures of a robot that stands on both feet beside a pole: the space in which a way for its hand is planned.
//
// A posture is given by torso and arm (C::moved); base and legs follow, so that the feet stay where they are and the centre of mass
// over them (ik/ik_feet.h). It is free where every sphere of the task keeps `margin()` to the pole and the hand `reach_clearance`,
// within the joint limits.
#ifndef CODEGEN_OFFLINE_POLE_SPACE_H_
#define CODEGEN_OFFLINE_POLE_SPACE_H_

#include "controller/ik/ik_feet.h"
#include "controller/ocp/ocp_obstacles.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace engram {

// Uniform in [lo, hi], the same numbers on every machine.
inline double uniform(std::mt19937_64& rng, double lo, double hi) { return lo + (hi - lo) * static_cast<double>(rng() >> 11) * 0x1p-53; }

// C: a configuration of the pole's task (loop_talos_pole.h).
template <class C> class PoleSpace {
 public:
  using R = typename C::Robot;
  using Task = typename C::Task;
  struct Node {
    double q[R::nq];
  };

  // Of a robot that stands as q does: its feet stay there. Spheres that are nearer to the pole than the margin already may be as near.
  explicit PoleSpace(const double* q) {
    std::copy_n(q, R::nq, start_.q);
    RbdData<R, double> d;
    rbd_kinematics<R>(q, d);
    rbd_subtree_moments<R>(d);
    const Vec3<double> com = rbd_com<R>(d);
    for (int i = 0; i < 3; ++i) com_[i] = com[i];
    for (int f = 0; f < C::Soles::n; ++f) {
      Mat3<double> R_WF;
      Vec3<double> p;
      rbd_frame_placement<R>(d, C::Soles::frame[f], R_WF, p);
      feet_[f] = {{p[0], p[1], p[2]}, std::atan2(R_WF(1, 0), R_WF(0, 0))};
    }
    margin_ = std::min(kMargin, clearance(d));
    hand_margin_ = std::min(Task::reach_clearance, hand_clearance(d));
  }

  const Node& start() const { return start_; }
  double margin() const { return margin_; }  // m

  void sample(std::mt19937_64& rng, Node& node) const {
    node = start_;
    for (int j = 0; j < C::nmoved; ++j) node.q[joint(j)] = uniform(rng, lo(j), hi(j));
  }
  double distance(const Node& a, const Node& b) const {
    double sum = 0.0;
    for (int j = 0; j < C::nmoved; ++j) sum += std::pow(weight(j) * (a.q[joint(j)] - b.q[joint(j)]), 2);
    return std::sqrt(sum);
  }
  bool step(const Node& from, const Node& to, Node& next, bool& there) const {
    const double way = distance(from, to), share = way > kStep ? kStep / way : 1.0;
    there = share == 1.0;
    Node at = from;
    for (int j = 0; j < C::nmoved; ++j) at.q[joint(j)] += share * (to.q[joint(j)] - at.q[joint(j)]);
    if (!stand(at) || !free(at)) return false;
    next = at;
    return true;
  }

  // Up to n postures whose hand is at p [m], the nearest to home first. Their number; 0: p is out of reach, or in the way of the pole.
  int reach(const double* p, uint64_t seed, Node* goals, int n) const {
    std::mt19937_64 rng(seed);
    int found = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      Node node = start_;
      if (draw > 0) sample(rng, node);
      if (!put_hand(p, node) || !free(node)) continue;
      if (found < n) goals[found++] = node;
      else if (from_home(node) < from_home(goals[found - 1])) goals[found - 1] = node;
      for (int i = found - 1; i > 0 && from_home(goals[i]) < from_home(goals[i - 1]); --i) std::swap(goals[i], goals[i - 1]);
    }
    return found;
  }
  // Where the hand is [m].
  void hand(const Node& node, double (&p)[3]) const { C::hand(node.q, p); }
  // What stays of feet [m, rad] and pole [m]: the largest distance of a sole from where it stood, and the smallest of a sphere from the pole.
  void measure(const Node& node, double& feet, double& pole) const {
    RbdData<R, double> d;
    rbd_kinematics<R>(node.q, d);
    pole = clearance(d);
    feet = 0.0;
    for (int f = 0; f < C::Soles::n; ++f) {
      Mat3<double> R_WF;
      Vec3<double> p;
      rbd_frame_placement<R>(d, C::Soles::frame[f], R_WF, p);
      for (int i = 0; i < 3; ++i) feet = std::max(feet, std::fabs(p[i] - feet_[f].p[i]));
      feet = std::max(feet, 1.0 - R_WF(2, 2));
    }
  }

 private:
  static constexpr double kMargin = 0.04;       // m, spheres to the pole; the controller's own begins at 0.06
  static constexpr double kStep = 0.15;         // rad, weighted
  static constexpr double kTorso = 0.3, kArm = 1.8;  // rad, torso and arm stay so near to home
  static constexpr double kLimit = 0.08;        // rad, kept to the joint limits
  static constexpr double kFeet = 1e-3, kHand = 5e-3;  // m, rad; m: what a projection may leave
  static constexpr int kDraws = 120, kReach = 12;

  static constexpr int joint(int j) { return R::nq - R::nu + C::moved[j]; }
  static constexpr bool torso(int j) { return j < 2; }
  static constexpr double weight(int j) { return torso(j) ? 2.0 : j < 6 ? 1.0 : 0.5; }  // the wrist moves the least
  static double lo(int j) { return std::max(R::q_lo[joint(j)] + kLimit, R::q_home[joint(j)] - (torso(j) ? kTorso : kArm)); }
  static double hi(int j) { return std::min(R::q_hi[joint(j)] - kLimit, R::q_home[joint(j)] + (torso(j) ? kTorso : kArm)); }
  static double from_home(const Node& node) {
    double sum = 0.0;
    for (int j = 0; j < C::nmoved; ++j) sum += std::pow(weight(j) * (node.q[joint(j)] - R::q_home[joint(j)]), 2);
    return sum;
  }

  static double nearest_box(const Vec3<double>& p) {
    Vec3<double> g;
    double least = HUGE_VAL;
    for (int o = 0; o < C::Field::count; ++o) least = std::min(least, C::Field::distance(o, p, g));
    return least;
  }
  static double hand_clearance(const RbdData<R, double>& d) { return nearest_box(C::hand_of(d)); }
  static double clearance(const RbdData<R, double>& d) {
    double least = HUGE_VAL;
    for (int s = 0; s < Task::nsphere; ++s) least = std::min(least, nearest_box(rbd_sphere_position<R, Task>(d, s)) - Task::sphere_radius[s]);
    return least;
  }

  // Base and legs follow torso and arm.
  bool stand(Node& node) const {
    IkFeetOptions o;
    o.iterations = 4;
    o.rest = 1e8;  // torso and arms are given
    double posture[R::nq];
    std::copy_n(node.q, R::nq, posture);
    std::copy_n(start_.q, R::nq - R::nu + o.nlegs, posture);  // base and legs
    return ik_feet<R>(C::Soles::frame, feet_, com_, posture, o, node.q) < kFeet;
  }
  bool free(const Node& node) const {
    for (int j = 0; j < C::nmoved; ++j) {
      const double q = node.q[joint(j)], q0 = start_.q[joint(j)];
      if (q < std::min(q0, R::q_lo[joint(j)] + kLimit) - 1e-6 || q > std::max(q0, R::q_hi[joint(j)] - kLimit) + 1e-6) return false;
    }
    RbdData<R, double> d;
    rbd_kinematics<R>(node.q, d);
    return clearance(d) >= margin_ - 1e-3 && hand_clearance(d) >= hand_margin_ - 1e-3;
  }
  // The hand goes to p by damped Gauss-Newton over torso and arm, the robot stands after every step.
  bool put_hand(const double* p, Node& node) const {
    for (int i = 0; i < kReach; ++i) {
      RbdData<R, double> d;
      rbd_kinematics<R>(node.q, d);
      const Vec3<double> at = C::hand_of(d), r(p[0] - at[0], p[1] - at[1], p[2] - at[2]);
      if (dot(r, r) < kHand * kHand) return stand(node);
      Mat<double, 6, R::nv> J;
      rbd_frame_jacobian<R>(d, C::kHand, at, J);
      Eigen::Matrix<double, 3, C::nmoved> A;
      for (int j = 0; j < C::nmoved; ++j) A.col(j) = J.template block<3, 1>(0, R::nv - R::nu + C::moved[j]) / weight(j);
      const Eigen::Matrix3d H = A * A.transpose() + 1e-4 * Eigen::Matrix3d::Identity();
      const Eigen::Matrix<double, C::nmoved, 1> dq = A.transpose() * H.llt().solve(Eigen::Vector3d(r[0], r[1], r[2]));
      const double largest = dq.cwiseAbs().maxCoeff(), share = largest > 0.3 ? 0.3 / largest : 1.0;
      for (int j = 0; j < C::nmoved; ++j)
        node.q[joint(j)] = std::clamp(node.q[joint(j)] + share * dq[j] / weight(j), lo(j), hi(j));
      if (!stand(node)) return false;
    }
    return false;
  }

  Node start_;
  IkFoot feet_[C::Soles::n];
  double com_[3];
  double margin_, hand_margin_;
};

}  // namespace engram
#endif  // CODEGEN_OFFLINE_POLE_SPACE_H_
