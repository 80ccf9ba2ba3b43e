// Costs of the studies, their refiner and the tensor-train cross in Python.
#include "codegen/binding/arrays.h"
#include "codegen/binding/engine_problems.h"
#include "codegen/offline/study_costs.h"
#include "codegen/offline/study_functions.h"
#include "codegen/offline/tt_cross.h"
#include "tables/panda/robot.h"
#include "tables/planar3/robot.h"
#include "tables/planar4/robot.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <limits>

namespace engram::binding {
namespace {

using offline::StudyCost;

std::unique_ptr<StudyCost> arm(const std::string& name, const std::vector<double>& from, const std::vector<double>& to) {
  const auto dot = name.find('.');
  const std::string robot = name.substr(0, dot), what = dot == std::string::npos ? "" : name.substr(dot + 1);
  const offline::Ends ends{from, to};
  std::unique_ptr<StudyCost> cost = robot == "panda"  ? offline::panda_cost(what, ends)
                                    : robot == "ur10" ? offline::ur10_cost(what)
                                                      : offline::planar_cost(robot, what, ends);
  if (!cost) {
    throw nb::value_error(("no such cost: '" + name + "'; robots: panda, ur10, planar3, planar4; costs: ik, pose, reach, pick, transfer").c_str());
  }
  return cost;
}

template <class R> Out path_of(const double* q0, const double* q1, const double* w) {
  NewArray q({std::size_t(offline::Primitive::kPoints), std::size_t(R::nq)});
  offline::primitive_path<R>(q0, q1, w, q.data());
  return q.release();
}
Out path(const std::string& robot, const In<1>& q0, const In<1>& q1, const In<1>& w) {
  const auto sizes = [&](long nq) {
    check_shape<1>("q0", q0, {nq});
    check_shape<1>("q1", q1, {nq});
    check_shape<1>("w", w, {offline::Primitive::kBasis * nq});
  };
  const auto of = [&](auto R) {
    sizes(decltype(R)::nq);
    return path_of<decltype(R)>(q0.data(), q1.data(), w.data());
  };
  if (robot == "panda") return of(robots::Panda{});
  if (robot == "planar3") return of(robots::Planar3{});
  if (robot == "planar4") return of(robots::Planar4{});
  throw nb::value_error("robot: panda, planar3 or planar4");
}

template <class F> std::unique_ptr<StudyCost> function(F f, std::vector<double> lo, std::vector<double> hi, int ntask, int power, bool complement = false) {
  auto cost = std::make_unique<offline::StudyCostOf<F, double>>(std::move(f));
  cost->lo = std::move(lo);
  cost->hi = std::move(hi);
  cost->ntask = ntask;
  cost->power = power;
  cost->complement = complement;
  return cost;
}

std::unique_ptr<StudyCost> benchmark(const std::string& name, int d) {
  if (name == "sinusoid") return function(offline::Sinusoid{}, {-2, -2}, {2, 2}, 0, 2, true);
  if (name == "himmelblau") return function(offline::Himmelblau{}, {0, 0, -5, -5}, {15, 15, 5, 5}, 2, 2);
  if (name == "rosenbrock" && d >= 2 && d % 2 == 0) {
    std::vector<double> lo(d + 2, -2.0), hi(d + 2, 2.0);
    lo[0] = -1.5, hi[0] = 1.5, lo[1] = 50, hi[1] = 150;
    return function(offline::Rosenbrock{d + 2}, lo, hi, 2, 2);
  }
  throw nb::value_error("no such function: sinusoid, himmelblau, or rosenbrock with an even number of variables");
}

std::unique_ptr<StudyCost> mixture(const In<1>& weight, const In<1>& sharpness, const In<2>& mean, bool plain) {
  const std::size_t J = mean.shape(0), d = mean.shape(1);
  check_shape<1>("weight", weight, {long(J)});
  check_shape<1>("sharpness", sharpness, {long(J)});
  return function(offline::GaussianMixture{int(d), plain,
                                           {weight.data(), weight.data() + J},
                                           {sharpness.data(), sharpness.data() + J},
                                           {mean.data(), mean.data() + J * d}},
                  std::vector<double>(d, -2.0), std::vector<double>(d, 2.0), 0, 1, plain);
}

Out by_ik(const std::string& robot, const In<2>& x, int iterations) {
  const bool panda = robot == "panda";
  if (!panda && robot != "ur10") throw nb::value_error("no such robot: panda, ur10");
  check_shape<2>("x", x, {-1, panda ? 10 : 9});
  NewArray out({x.shape(0), x.shape(1)});
  std::copy_n(x.data(), x.size(), out.data());
  (panda ? offline::panda_ik : offline::ur10_ik)(out.data(), x.shape(0), iterations);
  return out.release();
}

nb::tuple gradient(const StudyCost& cost, const In<2>& x) {
  check_shape<2>("x", x, {-1, cost.d()});
  NewArray c({x.shape(0)}), g({x.shape(0), x.shape(1)});
  cost.evaluate(x.data(), x.shape(0), c.data(), g.data());
  return nb::make_tuple(c.release(), g.release());
}

Out evaluate(const StudyCost& cost, const In<2>& x) {
  check_shape<2>("x", x, {-1, cost.d()});
  NewArray c({x.shape(0)});
  {
    nb::gil_scoped_release release;
    cost.evaluate(x.data(), x.shape(0), c.data(), nullptr);
  }
  return c.release();
}

Out density(const StudyCost& cost, const In<2>& x) {
  check_shape<2>("x", x, {-1, cost.d()});
  NewArray p({x.shape(0)});
  cost.density(x.data(), x.shape(0), p.data());
  return p.release();
}

nb::tuple refine(const StudyCost& cost, const In<2>& x, int evaluations, double enough) {
  check_shape<2>("x", x, {-1, cost.d()});
  NewArray out({x.shape(0), x.shape(1)}), c({x.shape(0)});
  std::copy_n(x.data(), x.size(), out.data());
  {
    nb::gil_scoped_release release;
    cost.refine(out.data(), x.shape(0), evaluations, enough, c.data());
  }
  return nb::make_tuple(out.release(), c.release());
}

// Cores (r, n, s) of a train as numpy arrays, and back.
nb::list cores_of(const offline::Train& train) {
  nb::list cores;
  for (int k = 0; k < train.d(); ++k) {
    const auto& core = train.core[k];
    const std::size_t n = train.n[k], r = core.rows() / n, s = core.cols();
    NewArray array({r, n, s});
    for (std::size_t a = 0; a < r * n; ++a)
      for (std::size_t b = 0; b < s; ++b) array.data()[a * s + b] = core(a, b);
    cores.append(array.release());
  }
  return cores;
}
offline::Train train_of(const nb::list& cores) {
  offline::Train train;
  for (nb::handle item : cores) {
    const auto array = nb::cast<In<3>>(item);
    const std::size_t r = array.shape(0), n = array.shape(1), s = array.shape(2);
    train.n.push_back(int(n));
    Eigen::MatrixXd core(r * n, s);
    for (std::size_t a = 0; a < r * n; ++a)
      for (std::size_t b = 0; b < s; ++b) core(a, b) = array.data()[a * s + b];
    train.core.push_back(std::move(core));
  }
  return train;
}

nb::tuple cross(const StudyCost& cost, const std::vector<int>& points, const In<2>& starts, int rank, int enrich, int sweeps,
                double tolerance, uint64_t seed, int spread) {
  const int d = cost.d();
  check_shape<2>("starts", starts, {-1, d});
  if (int(points.size()) != d) throw nb::value_error("points: one number for each variable");
  std::vector<double> step(d);
  for (int k = 0; k < d; ++k) {
    if (points[k] < 2) throw nb::value_error("points: at least two");
    step[k] = (cost.hi[k] - cost.lo[k]) / (points[k] - 1);
  }
  std::vector<int32_t> index(starts.size());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const int k = int(i % d);
    index[i] = int32_t(std::lround(std::min(std::max((starts.data()[i] - cost.lo[k]) / step[k], 0.0), points[k] - 1.0)));
  }
  offline::CrossOptions options;
  options.rank = rank;
  options.enrich = enrich;
  options.sweeps = sweeps;
  options.spread = std::min(std::max(spread, 0), d);
  options.tolerance = tolerance;
  options.seed = seed;
  int64_t evaluations = 0;
  offline::Train train;
  {
    nb::gil_scoped_release release;
    std::vector<double> x;
    const auto f = [&](const int32_t* at, std::size_t m, double* value) {
      x.resize(m * d);
      for (std::size_t i = 0; i < m; ++i)
        for (int k = 0; k < d; ++k) x[i * d + k] = cost.lo[k] + at[i * d + k] * step[k];
      cost.density(x.data(), m, value);
    };
    train = offline::tt_cross(f, points, index, options, evaluations);
  }
  return nb::make_tuple(cores_of(train), evaluations);
}

nb::list round(const nb::list& cores, int rank, double tolerance) {
  const offline::Train train = train_of(cores);
  offline::Train rounded;
  {
    nb::gil_scoped_release release;
    rounded = offline::tt_round(train, rank, tolerance);
  }
  return cores_of(rounded);
}

}  // namespace

void bind_study(nb::module_& engine) {
  using namespace nb::literals;
  nb::class_<StudyCost>(engine, "StudyCost", "A cost over a box whose first `ntask` variables are the task.")
      .def_rw("lo", &StudyCost::lo, "The box (d); it may be narrowed.")
      .def_rw("hi", &StudyCost::hi)
      .def_ro("ntask", &StudyCost::ntask)
      .def_prop_ro("d", &StudyCost::d)
      .def_rw("scale", &StudyCost::scale, "Density: exp(-(scale C)^power), for costs that are not densities by nature.")
      .def_rw("power", &StudyCost::power, "1 or 2.")
      .def("evaluate", &evaluate, "x"_a, "Cost (m) at x (m, d).")
      .def("gradient", &gradient, "x"_a, "Cost (m) and gradient (m, d) at x (m, d).")
      .def("density", &density, "x"_a, "Density (m) at x (m, d).")
      .def("refine", &refine, "x"_a, "evaluations"_a = 100, "enough"_a = -std::numeric_limits<double>::infinity(),
           "x (m, d) with all but the task moved downhill by projected BFGS, until its cost is `enough`; and the cost (m) there.")
      .def("cross", &cross, "points"_a, "starts"_a, "rank"_a, "enrich"_a = 8, "sweeps"_a = 4, "tolerance"_a = 1e-8, "seed"_a = 1, "spread"_a = 0,
           "Cores of a tensor train of the density on a grid of `points`, grown from `starts` (m, d); and how many values it took.");
  engine.def("study_arm", &arm, "name"_a, "from_"_a = std::vector<double>{}, "to"_a = std::vector<double>{},
             "Cost on a compiled robot: 'panda.ik', ...; the ends of a 'transfer'.");
  engine.def("study_ik", &by_ik, "robot"_a, "x"_a, "iterations"_a = 24,
             "Points x (m, 3 + nq) of 'panda.ik' or 'ur10.ik' with the postures that controller/ik makes of theirs; it sees no obstacle.");
  engine.def("study_path", &path, "robot"_a, "q0"_a, "q1"_a, "w"_a, "Points (m, nq) of the motion primitive from q0 to q1.");
  engine.def("study_function", &benchmark, "name"_a, "d"_a = 2, "A benchmark function.");
  engine.def("study_mixture", &mixture, "weight"_a, "sharpness"_a, "mean"_a, "plain"_a = false,
             "A mixture P of Gaussians (J), (J), (J, d) over [-2, 2]^d: as cost -log P, or 1 - P.");
  engine.def("tt_round", &round, "cores"_a, "rank"_a = 1 << 30, "tolerance"_a = 1e-12, "The nearest train of smaller rank.");
}

}  // namespace engram::binding
