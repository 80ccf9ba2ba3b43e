#include "codegen/offline/ipopt_solve.h"

#include <coin/IpIpoptApplication.hpp>
#include <coin/IpIpoptCalculatedQuantities.hpp>
#include <coin/IpIpoptData.hpp>
#include <coin/IpTNLP.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace engram::offline {
namespace {

using Ipopt::Index;
using Ipopt::Number;

constexpr double kNoBound = 1e19;  // Ipopt's default for "no bound"

const char* words(Ipopt::ApplicationReturnStatus status) {
  switch (status) {
    case Ipopt::Solve_Succeeded:
      return "solved";
    case Ipopt::Solved_To_Acceptable_Level:
      return "solved to acceptable level";
    case Ipopt::Infeasible_Problem_Detected:
      return "infeasible";
    case Ipopt::Search_Direction_Becomes_Too_Small:
      return "search direction too small";
    case Ipopt::Diverging_Iterates:
      return "diverging";
    case Ipopt::Maximum_Iterations_Exceeded:
      return "iteration limit";
    case Ipopt::Restoration_Failed:
      return "restoration failed";
    case Ipopt::Error_In_Step_Computation:
      return "error in step computation";
    case Ipopt::Not_Enough_Degrees_Of_Freedom:
      return "not enough degrees of freedom";
    case Ipopt::Invalid_Number_Detected:
      return "not finite";
    default:
      return "failed";
  }
}

class Adapter : public Ipopt::TNLP {
 public:
  Adapter(Program program, std::vector<double> z0, IpoptResult* result)
      : p_(std::move(program)), z0_(std::move(z0)), result_(result) {
    p_.gradient.resize(p_.variables);
    p_.g.resize(p_.constraints);
    p_.jacobian_value.resize(p_.jacobian.row.size());
    p_.hessian_value.resize(p_.hessian.row.size());
  }

  bool get_nlp_info(Index& n, Index& m, Index& jacobian, Index& hessian, IndexStyleEnum& style) override {
    n = p_.variables;
    m = p_.constraints;
    jacobian = Index(p_.jacobian.row.size());
    hessian = Index(p_.hessian.row.size());
    style = C_STYLE;
    return true;
  }

  bool get_bounds_info(Index, Number* z_lo, Number* z_hi, Index, Number* g_lo, Number* g_hi) override {
    const auto bound = [](double b) { return std::clamp(b, -kNoBound, kNoBound); };
    std::transform(p_.z_lo.begin(), p_.z_lo.end(), z_lo, bound);
    std::transform(p_.z_hi.begin(), p_.z_hi.end(), z_hi, bound);
    std::transform(p_.g_lo.begin(), p_.g_lo.end(), g_lo, bound);
    std::transform(p_.g_hi.begin(), p_.g_hi.end(), g_hi, bound);
    return true;
  }

  bool get_starting_point(Index, bool, Number* z, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy(z0_.begin(), z0_.end(), z);
    return true;
  }

  bool eval_f(Index, const Number* z, bool fresh, Number& objective) override {
    update(z, fresh);
    objective = p_.objective;
    return std::isfinite(objective);
  }

  bool eval_grad_f(Index, const Number* z, bool fresh, Number* gradient) override {
    update(z, fresh);
    std::copy(p_.gradient.begin(), p_.gradient.end(), gradient);
    return true;
  }

  bool eval_g(Index, const Number* z, bool fresh, Index, Number* g) override {
    update(z, fresh);
    std::copy(p_.g.begin(), p_.g.end(), g);
    return true;
  }

  bool eval_jac_g(Index, const Number* z, bool fresh, Index, Index, Index* row, Index* column, Number* value) override {
    if (value == nullptr) {
      std::copy(p_.jacobian.row.begin(), p_.jacobian.row.end(), row);
      std::copy(p_.jacobian.column.begin(), p_.jacobian.column.end(), column);
      return true;
    }
    update(z, fresh);
    std::copy(p_.jacobian_value.begin(), p_.jacobian_value.end(), value);
    return true;
  }

  // Gauss-Newton: the curvature of the constraints is left out.
  bool eval_h(Index, const Number* z, bool fresh, Number factor, Index, const Number*, bool, Index, Index* row, Index* column,
              Number* value) override {
    if (value == nullptr) {
      std::copy(p_.hessian.row.begin(), p_.hessian.row.end(), row);
      std::copy(p_.hessian.column.begin(), p_.hessian.column.end(), column);
      return true;
    }
    update(z, fresh);
    std::transform(p_.hessian_value.begin(), p_.hessian_value.end(), value, [factor](double h) { return factor * h; });
    return true;
  }

  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* z, const Number*, const Number*, Index, const Number*,
                         const Number*, Number objective, const Ipopt::IpoptData* data,
                         Ipopt::IpoptCalculatedQuantities* quantities) override {
    result_->z.assign(z, z + n);
    result_->objective = objective;
    if (data != nullptr) result_->iterations = data->iter_count();
    if (quantities != nullptr) result_->violation = quantities->unscaled_curr_nlp_constraint_violation(Ipopt::NORM_MAX);
  }

 private:
  void update(const double* z, bool fresh) {
    if (fresh || !evaluated_) p_.evaluate(z, p_);
    evaluated_ = true;
  }

  Program p_;
  std::vector<double> z0_;
  IpoptResult* result_;
  bool evaluated_ = false;
};

}  // namespace

IpoptResult ipopt_solve(Program program, std::vector<double> z0, const IpoptOptions& options) {
  IpoptResult result;
  result.z = z0;
  const Ipopt::SmartPtr<Ipopt::TNLP> nlp = new Adapter(std::move(program), std::move(z0), &result);
  const Ipopt::SmartPtr<Ipopt::IpoptApplication> app = IpoptApplicationFactory();
  app->Options()->SetIntegerValue("print_level", options.print_level);
  app->Options()->SetStringValue("sb", "yes");  // no banner
  app->Options()->SetIntegerValue("max_iter", options.iterations);
  app->Options()->SetNumericValue("tol", options.tolerance);
  app->Options()->SetNumericValue("bound_relax_factor", 0.0);
  app->Options()->SetStringValue("honor_original_bounds", "yes");
  app->Options()->SetStringValue("hessian_approximation", options.limited_memory ? "limited-memory" : "exact");
  if (app->Initialize() != Ipopt::Solve_Succeeded) {
    result.status = "Ipopt does not start";
    return result;
  }
  const Ipopt::ApplicationReturnStatus status = app->OptimizeTNLP(nlp);
  result.solved = status == Ipopt::Solve_Succeeded || status == Ipopt::Solved_To_Acceptable_Level;
  result.status = words(status);
  return result;
}

}  // namespace engram::offline
