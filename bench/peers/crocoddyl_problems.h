// The benchmark problems, stated for Crocoddyl.
#ifndef BENCH_PEERS_CROCODDYL_PROBLEMS_H_
#define BENCH_PEERS_CROCODDYL_PROBLEMS_H_

#include "bench/peers/model_text.h"

#include <memory>
#include <string>
#include <vector>

#include "crocoddyl/core/costs/cost-sum.hpp"
#include "crocoddyl/core/costs/residual.hpp"
#include "crocoddyl/core/integrator/euler.hpp"
#include "crocoddyl/core/optctrl/shooting.hpp"
#include "crocoddyl/core/residuals/control.hpp"
#include "crocoddyl/multibody/actions/free-fwddyn.hpp"
#include "crocoddyl/multibody/actuations/full.hpp"
#include "crocoddyl/multibody/residuals/frame-placement.hpp"
#include "crocoddyl/multibody/residuals/state.hpp"
#include "crocoddyl/multibody/states/multibody.hpp"

namespace bench {

using Vectors = std::vector<Eigen::VectorXd>;

struct Problem {
  std::shared_ptr<crocoddyl::ShootingProblem> shooting;
  Vectors xs, us;  // cold start: hold the first state against gravity
};

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
  const std::vector<std::shared_ptr<ActionModelAbstract>> running_models(T, knot(running, 0.01));
  Problem problem;
  problem.shooting = std::make_shared<ShootingProblem>(x0, running_models, knot(terminal, 0));
  problem.shooting->set_nthreads(1);
  problem.xs.assign(T + 1, x0);
  problem.us = problem.shooting->quasiStatic_xs(Vectors(T, x0));
  return problem;
}

inline Problem make_problem(const std::string& name, const RobotModel& robot) {
  if (name == "arm30") return arm(robot, 30);
  if (name == "arm100") return arm(robot, 100);
  throw std::runtime_error("unknown problem " + name);
}

}  // namespace bench
#endif  // BENCH_PEERS_CROCODDYL_PROBLEMS_H_
