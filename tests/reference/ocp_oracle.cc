// One knot of a problem that holds every term, on ANYmal with a surface and a point contact, for tests in Python (ctypes).
//
// Two problems, one for each choice of axes of the contact forces; all terms weigh nothing but the one that the caller parametrizes.
#include "codegen/offline/dense_model.h"
#include "controller/ocp/ocp_com.h"
#include "controller/ocp/ocp_contact.h"
#include "controller/ocp/ocp_frame.h"
#include "controller/ocp/ocp_frame_reach.h"
#include "controller/ocp/ocp_motion_residuals.h"
#include "controller/ocp/ocp_regularization.h"
#include "controller/ocp/ocp_zmp.h"
#include "tables/anymal/robot.h"

#include <algorithm>
#include <memory>
#include <string>

namespace engram {
namespace {

using R = robots::Anymal;

// The left fore foot as a sole, the right hind foot as a point.
template <Axes axes_> struct Feet {
  using Robot = R;
  static constexpr int n = 2;
  static constexpr int frame[n] = {R::kLfFoot, R::kRhFoot};
  static constexpr ContactKind kind[n] = {ContactKind::kSurface, ContactKind::kPoint};
  static constexpr Axes axes = axes_;
  static constexpr double kp = 40.0, kd = 12.0;
};

template <Axes axes> using Velocity = ResidualTerm<FrameVelocity<R, R::kLfFoot, axes>>;
using VelocityBounds = ResidualTerm<FrameVelocity<R, R::kRhFoot, Axes::kLocal>, Bounded>;
using Rotation = ResidualTerm<FrameRotation<R, R::kLfFoot>>;
using Momentum = ResidualTerm<CentroidalMomentum<R>>;
template <class C, class... More>
using Everything = ContactOcp<C, ConeLimit<WrenchConeTerm<0>>, ConeLimit<FrictionConeTerm<1>>,
                              Velocity<Axes::kLocal>, Velocity<Axes::kWorld>, Velocity<Axes::kLocalWorldAligned>, VelocityBounds, Rotation,
                              Momentum, StateBoundTerm<R>, ContactForceTerm<C, 0>, ContactForceTerm<C, 1>, CopTerm<0>, WrenchConeTerm<0>,
                              FrictionConeTerm<1>, ComTerm<R>, FramePlacementTerm<R, R::kRfFoot>, FrameReachTerm<R, R::kRfFoot>, More...>;

template <Axes axes> struct ProblemOf {
  using type = Everything<Feet<axes>>;
};
template <> struct ProblemOf<Axes::kLocalWorldAligned> {
  using C = Feet<Axes::kLocalWorldAligned>;
  using type = Everything<C, ZmpTerm<C>>;
};

template <class P> struct Oracle {
  using C = typename P::Contacts;
  using L = typename P::Layout;
  using Knot = typename P::template Knot<double>;

  // Writes n parameters of a term. False if there is no such term or it has not n.
  static bool set(const std::string& term, const double* values, int n, Knot& knot) {
    bool done = false;
    const auto put = [&](const char* name, auto& p) {
      if (term != name || n * sizeof(double) != sizeof(p)) return;
      std::copy_n(values, n, reinterpret_cast<double*>(&p));
      done = true;
    };
    put("wrench_limit", param_of<ConeLimit<WrenchConeTerm<0>>>(knot));
    put("friction_limit", param_of<ConeLimit<FrictionConeTerm<1>>>(knot));
    put("velocity_local", param_of<Velocity<Axes::kLocal>>(knot));
    put("velocity_world", param_of<Velocity<Axes::kWorld>>(knot));
    put("velocity_aligned", param_of<Velocity<Axes::kLocalWorldAligned>>(knot));
    put("velocity_bounds", param_of<VelocityBounds>(knot));
    put("rotation", param_of<Rotation>(knot));
    put("momentum", param_of<Momentum>(knot));
    put("state_bounds", param_of<StateBoundTerm<R>>(knot));
    put("force_sole", param_of<ContactForceTerm<C, 0>>(knot));
    put("force_point", param_of<ContactForceTerm<C, 1>>(knot));
    put("cop", param_of<CopTerm<0>>(knot));
    put("wrench_cone", param_of<WrenchConeTerm<0>>(knot));
    put("friction_cone", param_of<FrictionConeTerm<1>>(knot));
    put("com", param_of<ComTerm<R>>(knot));
    put("placement", param_of<FramePlacementTerm<R, R::kRfFoot>>(knot));
    put("reach", param_of<FrameReachTerm<R, R::kRfFoot>>(knot));
    put("contacts", knot.contact_ref);
    if constexpr (kContactAxes<C> == Axes::kLocalWorldAligned) put("zmp", param_of<ZmpTerm<C>>(knot));
    return done || term.empty();
  }

  // The knot's length is 1 s, so that v' - v is the acceleration (or the jump).
  static void run(unsigned phase, const Knot& knot, const double* x, const double* u, double* next, double* cost, double* lambda,
                  double* Fx, double* Fu, double* Lz, double* Lzz, double* F) {
    P::calc(phase, knot, x, u, next, *cost);
    auto d = std::make_unique<RbdData<R, double>>();
    auto cd = std::make_unique<ContactData<C, double>>();
    double a[P::nv], tau[P::nv];
    Actuation<R>::apply(u, tau);
    if (phase & kImpact) rbd_impulse(x, x + P::nq, phase & ~kImpact, *d, *cd, a);
    else rbd_contact_dynamics(x, x + P::nq, tau, knot.reference(), phase, *d, *cd, a);
    rbd_contact_forces_seen(phase & ~kImpact, *cd, lambda);
    if (!Lz) return;

    typename P::template Knot<Pack> knots;
    Pack xs[P::nx], us[P::nu], nexts[P::nx], costs;
    for (std::size_t e = 0; e < sizeof(knot) / sizeof(double); ++e)
      reinterpret_cast<Pack*>(&knots)[e] = reinterpret_cast<const double*>(&knot)[e];
    for (int i = 0; i < P::nx; ++i) xs[i] = x[i];
    for (int i = 0; i < P::nu; ++i) us[i] = u[i];
    auto lanes = std::make_unique<typename P::Lanes>();
    auto m = std::make_unique<typename P::LqModel>();
    P::linearize(phase, knots, xs, us, nexts, costs, *lanes);
    P::finish(phase, knot.dt, *lanes, 0, *m);
    offline::dense_dynamics<P>(*m, knot.dt, Fx, Fu);
    for (int i = 0; i < P::nz; ++i) {
      Lz[i] = m->Lz[padded_index<L>(i)];
      for (int j = 0; j < P::nz; ++j) Lzz[i * P::nz + j] = offline::dense_hessian(*m, i, j);
      for (int r = 0; r < P::nf; ++r) F[r * P::nz + i] = m->F[r][padded_index<L>(i)];
    }
  }

  // Terms may be given one after the other: names separated by commas, their sizes in n.
  static int solve(const char* terms, const double* values, const int* n, unsigned phase, const double* x, const double* u, double* next,
                   double* cost, double* lambda, double* Fx, double* Fu, double* Lz, double* Lzz, double* F) {
    Knot knot = {};
    std::copy_n(R::q_home, P::nq, param_of<StateBoundTerm<R>>(knot).bound_ref);  // rotations that are some, for terms that weigh nothing
    for (int i = 0; i < 9; i += 4) param_of<Rotation>(knot).ref.R_WF[i] = param_of<FramePlacementTerm<R, R::kRfFoot>>(knot).placement_R[i] = 1.0;
    param_of<FrameReachTerm<R, R::kRfFoot>>(knot).reach_near = 1.0;
    knot.dt = phase & kImpact ? 0.0 : 1.0;
    std::string left = terms;
    for (; !left.empty(); values += *n++) {
      const std::string name = left.substr(0, left.find(','));
      left.erase(0, std::min(left.size(), name.size() + 1));
      if (!set(name, values, *n, knot)) return 1;
    }
    run(phase, knot, x, u, next, cost, lambda, Fx, Fu, Lz, Lzz, F);
    return 0;
  }
};

}  // namespace
}  // namespace engram

// axes: 0 local, otherwise the world's. Lz null: next state, cost and forces only. Returns 0, or 1 if a term or its size is wrong.
extern "C" int ocp_knot(int axes, const char* terms, const double* values, const int* n, unsigned phase, const double* x, const double* u,
                        double* next, double* cost, double* lambda, double* Fx, double* Fu, double* Lz, double* Lzz, double* F) {
  using namespace engram;
  const auto solve = [&](auto problem) {
    return Oracle<typename decltype(problem)::type>::solve(terms, values, n, phase, x, u, next, cost, lambda, Fx, Fu, Lz, Lzz, F);
  };
  return axes == 0 ? solve(ProblemOf<Axes::kLocal>{}) : solve(ProblemOf<Axes::kLocalWorldAligned>{});
}
