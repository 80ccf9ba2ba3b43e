// What a benchmark problem is on Crocoddyl's side.
#ifndef BENCH_PEERS_CROCODDYL_PROBLEM_H_
#define BENCH_PEERS_CROCODDYL_PROBLEM_H_

#include "bench/peers/model_text.h"

#include <memory>
#include <string>
#include <vector>

#include "crocoddyl/core/costs/cost-sum.hpp"
#include "crocoddyl/core/costs/residual.hpp"
#include "crocoddyl/core/integrator/euler.hpp"
#include "crocoddyl/core/optctrl/shooting.hpp"
#include "crocoddyl/core/residuals/control.hpp"
#include "crocoddyl/multibody/residuals/frame-placement.hpp"
#include "crocoddyl/multibody/residuals/state.hpp"
#include "crocoddyl/multibody/states/multibody.hpp"

namespace bench {

using Vectors = std::vector<Eigen::VectorXd>;
using Action = std::shared_ptr<crocoddyl::ActionModelAbstract>;
using Actions = std::vector<Action>;

struct Problem {
  std::shared_ptr<crocoddyl::ShootingProblem> shooting;
  Vectors xs, us;  // cold start: hold the first state against gravity
};

}  // namespace bench
#endif  // BENCH_PEERS_CROCODDYL_PROBLEM_H_
