// Walking problems, stated for Crocoddyl as its own examples state them (crocoddyl.utils.biped and .quadruped).
#ifndef BENCH_PEERS_CROCODDYL_LEGGED_H_
#define BENCH_PEERS_CROCODDYL_LEGGED_H_

#include "bench/peers/crocoddyl_problem.h"

#include <pinocchio/algorithm/center-of-mass.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <utility>

#include "crocoddyl/core/activations/quadratic-barrier.hpp"
#include "crocoddyl/core/activations/weighted-quadratic.hpp"
#include "crocoddyl/multibody/actions/contact-fwddyn.hpp"
#include "crocoddyl/multibody/actions/impulse-fwddyn.hpp"
#include "crocoddyl/multibody/actuations/floating-base.hpp"
#include "crocoddyl/multibody/contacts/contact-3d.hpp"
#include "crocoddyl/multibody/contacts/contact-6d.hpp"
#include "crocoddyl/multibody/contacts/multiple-contacts.hpp"
#include "crocoddyl/multibody/friction-cone.hpp"
#include "crocoddyl/multibody/impulses/impulse-3d.hpp"
#include "crocoddyl/multibody/impulses/impulse-6d.hpp"
#include "crocoddyl/multibody/impulses/multiple-impulses.hpp"
#include "crocoddyl/multibody/residuals/com-position.hpp"
#include "crocoddyl/multibody/residuals/contact-friction-cone.hpp"
#include "crocoddyl/multibody/residuals/contact-wrench-cone.hpp"
#include "crocoddyl/multibody/residuals/frame-translation.hpp"
#include "crocoddyl/multibody/wrench-cone.hpp"

namespace bench {

using Frames = std::vector<std::size_t>;
using FootTargets = std::vector<std::pair<std::size_t, Eigen::Vector3d>>;

// Which costs a step has: those of the example, or those of the thesis (regularization, one waypoint, the landing).
enum class Costs { kExample, kThesis };

// A walking robot: makes the knots of its phases. Feet are surfaces (6D contacts) or points (3D).
class Walker {
 public:
  Walker(const RobotModel& robot, bool surfaces, double dt)
      : robot_(robot),
        model_(std::make_shared<pinocchio::Model>(robot.model)),
        state_(std::make_shared<crocoddyl::StateMultibody>(model_)),
        actuation_(std::make_shared<crocoddyl::ActuationModelFloatingBase>(state_)),
        x0_(state_->get_nx()),
        surfaces_(surfaces),
        dt_(dt) {
    x0_ << robot.q_ref, Eigen::VectorXd::Zero(model_->nv);
  }

  std::size_t frame(const std::string& name) const { return model_->getFrameId(name); }

  std::vector<Eigen::Vector3d> positions(const Frames& frames) const {
    pinocchio::Data data(*model_);
    pinocchio::forwardKinematics(*model_, data, robot_.q_ref);
    pinocchio::updateFramePlacements(*model_, data);
    std::vector<Eigen::Vector3d> result;
    for (std::size_t id : frames) result.push_back(data.oMf[id].translation());
    return result;
  }

  double com_height() const {
    pinocchio::Data data(*model_);
    return pinocchio::centerOfMass(*model_, data, robot_.q_ref)[2];
  }

  // A knot in time on the supporting feet; `com` (may be null) and `feet` are targets.
  Action in_time(const Frames& support, const Eigen::Vector3d* com, const FootTargets& feet, Costs costs) const {
    using namespace crocoddyl;
    const std::size_t nu = actuation_->get_nu();
    const int nv = model_->nv;
    const auto contacts = std::make_shared<ContactModelMultiple>(state_, nu);
    const auto sum = std::make_shared<CostModelSum>(state_, nu);
    for (std::size_t id : support) contacts->addContact(name(id), contact(id, nu));
    if (com) sum->addCost("com", term(std::make_shared<ResidualModelCoMPosition>(state_, *com, nu)), 1e6);
    if (costs == Costs::kExample)
      for (std::size_t id : support) sum->addCost(name(id) + "_cone", cone(id, nu), 1e1);
    for (const auto& [id, target] : feet) sum->addCost(name(id) + "_foot", term(foot(id, target, nu)), 1e6);
    const double v_joint = surfaces_ ? 10 : 1;
    const Eigen::VectorXd w = weights({{0, 3}, {500, 3}, {0.01, nv - 6}, {10, 6}, {v_joint, nv - 6}});
    sum->addCost("state", state_regularization(w, nu), 1e1);
    sum->addCost("control", term(std::make_shared<ResidualModelControl>(state_, nu)), 1e-1);
    if (!surfaces_) sum->addCost("bounds", state_bounds(nu), 1e3);
    return std::make_shared<IntegratedActionModelEuler>(
        std::make_shared<DifferentialActionModelContactFwdDynamics>(state_, actuation_, contacts, sum, 0., true), dt_);
  }

  // The touch-down of feet at their targets.
  Action touch_down(const FootTargets& feet) const {
    using namespace crocoddyl;
    const int nv = model_->nv;
    const auto impulses = std::make_shared<ImpulseModelMultiple>(state_);
    const auto sum = std::make_shared<CostModelSum>(state_, std::size_t(0));
    for (const auto& [id, target] : feet) {
      if (surfaces_) impulses->addImpulse(name(id), std::make_shared<ImpulseModel6D>(state_, id, pinocchio::LOCAL_WORLD_ALIGNED));
      else impulses->addImpulse(name(id), std::make_shared<ImpulseModel3D>(state_, id, pinocchio::LOCAL_WORLD_ALIGNED));
      sum->addCost(name(id) + "_foot", term(foot(id, target, 0)), surfaces_ ? 1e8 : 1e7);
    }
    const Eigen::VectorXd w = weights({{1, 6}, {surfaces_ ? 0.1 : 10, nv - 6}, {10, nv}});
    sum->addCost("state", state_regularization(w, 0), 1e1);
    return std::make_shared<ActionModelImpulseFwdDynamics>(state_, impulses, sum, 0., 1e-12);
  }

  // A step of n knots and the touch-down: the swing feet move by `stride` on a triangle of the given height.
  // Advances `com` and the feet's positions.
  void step(Actions& actions, int n, const Frames& support, const Frames& swing, const Eigen::Vector3d& stride, double height,
            Costs costs, Eigen::Vector3d& com, std::vector<Eigen::Vector3d*> feet) const {
    const double share = double(swing.size()) / double(support.size() + swing.size()), peak = n / 2.0;
    FootTargets targets;
    for (int k = 0; k < n; ++k) {
      const double z = k < peak ? height * k / peak : height * (1 - (k - peak) / peak), done = double(k + 1) / n;
      targets.clear();
      for (std::size_t i = 0; i < swing.size(); ++i)
        targets.emplace_back(swing[i], *feet[i] + stride * done + Eigen::Vector3d(0, 0, z));
      const Eigen::Vector3d com_target = com + stride * done * share;
      if (costs == Costs::kThesis) actions.push_back(in_time(support, nullptr, k == n / 2 ? targets : FootTargets(), costs));
      else actions.push_back(in_time(support, &com_target, targets, costs));
    }
    actions.push_back(touch_down(targets));
    com += stride * share;
    for (Eigen::Vector3d* position : feet) *position += stride;
  }

  Problem problem(const Actions& running, Action terminal) const {
    Problem problem;
    problem.shooting = std::make_shared<crocoddyl::ShootingProblem>(x0_, running, terminal);
    problem.shooting->set_nthreads(1);
    problem.xs.assign(running.size() + 1, x0_);
    problem.us = problem.shooting->quasiStatic_xs(Vectors(running.size(), x0_));
    return problem;
  }

 private:
  using Residual = std::shared_ptr<crocoddyl::ResidualModelAbstract>;
  using Cost = std::shared_ptr<crocoddyl::CostModelAbstract>;

  const std::string& name(std::size_t frame) const { return model_->frames[frame].name; }

  // Squares of the values, each repeated.
  static Eigen::VectorXd weights(std::initializer_list<std::pair<double, int>> values) {
    std::vector<double> squares;
    for (const auto& [value, times] : values) squares.insert(squares.end(), times, value * value);
    return Eigen::Map<Eigen::VectorXd>(squares.data(), squares.size());
  }

  Cost term(Residual residual) const { return std::make_shared<crocoddyl::CostModelResidual>(state_, residual); }

  std::shared_ptr<crocoddyl::ContactModelAbstract> contact(std::size_t frame, std::size_t nu) const {
    using namespace crocoddyl;
    if (surfaces_)
      return std::make_shared<ContactModel6D>(state_, frame, pinocchio::SE3::Identity(), pinocchio::LOCAL_WORLD_ALIGNED, nu,
                                              Eigen::Vector2d(0, 30));
    return std::make_shared<ContactModel3D>(state_, frame, Eigen::Vector3d::Zero(), pinocchio::LOCAL_WORLD_ALIGNED, nu,
                                            Eigen::Vector2d(0, 50));
  }

  Residual foot(std::size_t frame, const Eigen::Vector3d& target, std::size_t nu) const {
    using namespace crocoddyl;
    if (surfaces_)
      return std::make_shared<ResidualModelFramePlacement>(state_, frame, pinocchio::SE3(Eigen::Matrix3d::Identity(), target),
                                                           nu);
    return std::make_shared<ResidualModelFrameTranslation>(state_, frame, target, nu);
  }

  Cost barrier(const crocoddyl::ActivationBounds& bounds, Residual residual) const {
    using namespace crocoddyl;
    return std::make_shared<CostModelResidual>(state_, std::make_shared<ActivationModelQuadraticBarrier>(bounds), residual);
  }

  Cost cone(std::size_t frame, std::size_t nu) const {
    using namespace crocoddyl;
    if (surfaces_) {
      const WrenchCone cone(Eigen::Matrix3d::Identity(), 0.7, Eigen::Vector2d(0.1, 0.05));
      return barrier(ActivationBounds(cone.get_lb(), cone.get_ub()),
                     std::make_shared<ResidualModelContactWrenchCone>(state_, frame, cone, nu, true));
    }
    const FrictionCone cone(Eigen::Matrix3d::Identity(), 0.7, 4, false);
    return barrier(ActivationBounds(cone.get_lb(), cone.get_ub()),
                   std::make_shared<ResidualModelContactFrictionCone>(state_, frame, cone, nu, true));
  }

  Cost state_regularization(const Eigen::VectorXd& weights, std::size_t nu) const {
    using namespace crocoddyl;
    return std::make_shared<CostModelResidual>(state_, std::make_shared<ActivationModelWeightedQuad>(weights),
                                               std::make_shared<ResidualModelState>(state_, x0_, nu));
  }

  Cost state_bounds(std::size_t nu) const {
    using namespace crocoddyl;
    const int nv = model_->nv;
    Eigen::VectorXd lo(2 * nv), hi(2 * nv);  // of the tangent: a free base has one coordinate less
    lo << state_->get_lb().segment(1, nv), state_->get_lb().tail(nv);
    hi << state_->get_ub().segment(1, nv), state_->get_ub().tail(nv);
    return barrier(ActivationBounds(lo, hi), std::make_shared<ResidualModelState>(state_, nu));
  }

  const RobotModel& robot_;
  std::shared_ptr<pinocchio::Model> model_;
  std::shared_ptr<crocoddyl::StateMultibody> state_;
  std::shared_ptr<crocoddyl::ActuationModelFloatingBase> actuation_;
  Eigen::VectorXd x0_;
  bool surfaces_;
  double dt_;
};

// Talos: per step 7 knots of double support, 15 of swing and the touch-down; then double support up to T knots of 40 ms.
inline Problem talos(const RobotModel& robot, int T, int steps, double length, Costs costs) {
  constexpr int kDouble = 7, kSwing = 15;
  constexpr double kHeight = 0.1;
  const Walker walker(robot, true, 0.04);
  const std::size_t right = walker.frame("right_sole_link"), left = walker.frame("left_sole_link");
  std::vector<Eigen::Vector3d> feet = walker.positions({right, left});
  Eigen::Vector3d com = (feet[0] + feet[1]) / 2;
  com[2] = walker.com_height();
  const auto double_support = [&] { return walker.in_time({right, left}, nullptr, {}, costs); };
  Actions actions;
  for (int s = 0; s < steps; ++s) {
    for (int k = 0; k < kDouble; ++k) actions.push_back(double_support());
    const Eigen::Vector3d stride(s == 0 ? length : 2 * length, 0, 0);
    if (s % 2 == 0) walker.step(actions, kSwing, {left}, {right}, stride, kHeight, costs, com, {&feet[0]});
    else walker.step(actions, kSwing, {right}, {left}, stride, kHeight, costs, com, {&feet[1]});
  }
  while (int(actions.size()) < T) actions.push_back(double_support());
  if (int(actions.size()) != T) throw std::runtime_error("the horizon is shorter than the steps");
  return walker.problem(actions, double_support());
}

// ANYmal: a trot of two half cycles, each 2 knots on four feet, 25 of swing and the touch-down; knots of 10 ms.
inline Problem anymal_trot(const RobotModel& robot) {
  constexpr int kDouble = 2, kSwing = 25;
  constexpr double kLength = 0.15, kHeight = 0.1;
  const Walker walker(robot, false, 0.01);
  const std::size_t lf = walker.frame("LF_FOOT"), rf = walker.frame("RF_FOOT"), lh = walker.frame("LH_FOOT"),
                    rh = walker.frame("RH_FOOT");
  std::vector<Eigen::Vector3d> feet = walker.positions({lf, rf, lh, rh});
  Eigen::Vector3d com = (feet[0] + feet[1] + feet[2] + feet[3]) / 4;
  com[2] = walker.com_height();
  const auto stand = [&] { return walker.in_time({lf, rf, lh, rh}, nullptr, {}, Costs::kExample); };
  Actions actions;
  for (int half = 0; half < 2; ++half) {
    for (int k = 0; k < kDouble; ++k) actions.push_back(stand());
    const Eigen::Vector3d stride(half == 0 ? kLength / 2 : kLength, 0, 0);
    if (half == 0) walker.step(actions, kSwing, {lf, rh}, {rf, lh}, stride, kHeight, Costs::kExample, com, {&feet[1], &feet[2]});
    else walker.step(actions, kSwing, {rf, lh}, {lf, rh}, stride, kHeight, Costs::kExample, com, {&feet[0], &feet[3]});
  }
  return walker.problem(actions, stand());
}

}  // namespace bench
#endif  // BENCH_PEERS_CROCODDYL_LEGGED_H_
