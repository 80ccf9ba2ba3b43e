// The benchmark problems, stated for Crocoddyl.
#ifndef BENCH_PEERS_CROCODDYL_PROBLEMS_H_
#define BENCH_PEERS_CROCODDYL_PROBLEMS_H_

#include "bench/peers/crocoddyl_legged.h"
#include "bench/peers/crocoddyl_problem.h"

#include "crocoddyl/multibody/actions/free-fwddyn.hpp"
#include "crocoddyl/multibody/actuations/floating-base-thrusters.hpp"
#include "crocoddyl/multibody/actuations/full.hpp"

namespace bench {

// Panda from its reference posture to a hand placement within T steps of 10 ms:
//   running  (dt x) 1/2 |log(M* ^-1 M)|^2 + 1/2 0.1 |x - x0|^2 + 1/2 0.1 |u|^2,   terminal  1/2 1000 |log(M* ^-1 M)|^2
// The costs are those of Crocoddyl's own arm example.
inline Problem arm(const RobotModel& robot, int T) {
  using namespace crocoddyl;
  const auto model = std::make_shared<pinocchio::Model>(robot.model);
  const auto state = std::make_shared<StateMultibody>(model);
  const auto actuation = std::make_shared<ActuationModelFull>(state);
  const std::size_t nu = actuation->get_nu();
  Eigen::VectorXd x0(state->get_nx());
  x0 << robot.q_ref, Eigen::VectorXd::Zero(model->nv);
  const pinocchio::SE3 M_goal(Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix(), Eigen::Vector3d(0.5, 0.3, 0.4));

  const auto term = [&](std::shared_ptr<ResidualModelAbstract> residual) {
    return std::make_shared<CostModelResidual>(state, residual);
  };
  const auto goal = term(std::make_shared<ResidualModelFramePlacement>(state, model->getFrameId("panda_hand_tcp"), M_goal, nu));
  const auto running = std::make_shared<CostModelSum>(state, nu);
  running->addCost("goal", goal, 1);
  running->addCost("state", term(std::make_shared<ResidualModelState>(state, x0, nu)), 0.1);
  running->addCost("control", term(std::make_shared<ResidualModelControl>(state, nu)), 0.1);
  const auto terminal = std::make_shared<CostModelSum>(state, nu);
  terminal->addCost("goal", goal, 1e3);

  const auto knot = [&](std::shared_ptr<CostModelSum> cost, double dt) {
    const auto dynamics = std::make_shared<DifferentialActionModelFreeFwdDynamics>(state, actuation, cost);
    return std::make_shared<IntegratedActionModelEuler>(dynamics, dt);
  };
  const Actions running_models(T, knot(running, 0.01));
  Problem problem;
  problem.shooting = std::make_shared<ShootingProblem>(x0, running_models, knot(terminal, 0));
  problem.shooting->set_nthreads(1);
  problem.xs.assign(T + 1, x0);
  problem.us = problem.shooting->quasiStatic_xs(Vectors(T, x0));
  return problem;
}

// Hector quadrotor from the origin to a placement within T steps of 30 ms; the costs are those of Crocoddyl's example.
inline Problem quadrotor(const RobotModel& robot, int T) {
  using namespace crocoddyl;
  constexpr double kArm = 0.1525, kLift = 6.6e-5, kDrag = 1e-6;  // [m], force and torque per squared speed
  const auto model = std::make_shared<pinocchio::Model>(robot.model);
  const auto state = std::make_shared<StateMultibody>(model);
  const Eigen::Vector3d arms[4] = {{kArm, 0, 0}, {0, kArm, 0}, {-kArm, 0, 0}, {0, -kArm, 0}};
  std::vector<Thruster> thrusters;
  for (int i = 0; i < 4; ++i)
    thrusters.emplace_back(pinocchio::SE3(Eigen::Matrix3d::Identity(), arms[i]), kDrag / kLift,
                           i % 2 ? ThrusterType::CW : ThrusterType::CCW);
  const auto actuation = std::make_shared<ActuationModelFloatingBaseThrusters>(state, thrusters);
  const std::size_t nu = actuation->get_nu();
  Eigen::VectorXd x0(state->get_nx()), weights(state->get_ndx());
  x0 << robot.q_ref, Eigen::VectorXd::Zero(model->nv);
  weights << Eigen::Vector3d::Constant(0.1), Eigen::Vector3d::Constant(1e3), Eigen::VectorXd::Constant(model->nv, 1e3);

  const pinocchio::SE3 M_goal(Eigen::Matrix3d::Identity(), Eigen::Vector3d(1, 0, 1));
  const auto goal = std::make_shared<CostModelResidual>(
      state, std::make_shared<ResidualModelFramePlacement>(state, model->getFrameId("base_link"), M_goal, nu));
  const auto running = std::make_shared<CostModelSum>(state, nu);
  running->addCost("state",
                   std::make_shared<CostModelResidual>(state, std::make_shared<ActivationModelWeightedQuad>(weights),
                                                       std::make_shared<ResidualModelState>(state, state->zero(), nu)),
                   1e-6);
  running->addCost("control", std::make_shared<CostModelResidual>(state, std::make_shared<ResidualModelControl>(state, nu)),
                   1e-6);
  running->addCost("goal", goal, 1e-2);
  const auto terminal = std::make_shared<CostModelSum>(state, nu);
  terminal->addCost("goal", goal, 3);

  const auto knot = [&](std::shared_ptr<CostModelSum> cost) {
    const auto dynamics = std::make_shared<DifferentialActionModelFreeFwdDynamics>(state, actuation, cost);
    return std::make_shared<IntegratedActionModelEuler>(dynamics, 0.03);
  };
  Problem problem;
  problem.shooting = std::make_shared<ShootingProblem>(x0, Actions(T, knot(running)), knot(terminal));
  problem.shooting->set_nthreads(1);
  problem.xs.assign(T + 1, x0);
  problem.us = problem.shooting->quasiStatic_xs(Vectors(T, x0));
  return problem;
}

inline Problem make_problem(const std::string& name, const RobotModel& robot) {
  if (name == "arm30") return arm(robot, 30);
  if (name == "arm100") return arm(robot, 100);
  if (name == "quad33") return quadrotor(robot, 33);
  if (name == "talos30") return talos(robot, 30, 1, 0.3, Costs::kExample);
  if (name == "talos30t") return talos(robot, 30, 1, 0.3, Costs::kThesis);
  if (name == "talos100") return talos(robot, 100, 4, 0.2, Costs::kExample);
  if (name == "anymal") return anymal_trot(robot);
  throw std::runtime_error("unknown problem " + name);
}

}  // namespace bench
#endif  // BENCH_PEERS_CROCODDYL_PROBLEMS_H_
