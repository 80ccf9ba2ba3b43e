// Steps of Talos in Python: the problem of one step or of several, its planner, and cold starts.
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/problem.h"
#include "controller/loop/loop_steps.h"

#include <nanobind/stl/vector.h>

#include <vector>

namespace engram::binding {
namespace {

class StepProblem : public Problem<TalosSteps::P, TalosSteps::N> {
  using R = TalosSteps::R;
  static constexpr int nq = R::nq;

 public:
  StepProblem(double cone, int between) : steps_(cone, checked(between)) {}

  // Feet (2, 3) left and right as (x, y, yaw) [m, rad] on the ground, goals (n, 3), and the foot of the first step; feet alternate.
  void set(const In<2>& feet, const In<2>& goals, int first) {
    check_shape<2>("feet", feet, {2, 3});
    check_shape<2>("goals", goals, {-1, 3});
    const int n = int(goals.shape(0));
    if (n < 1 || n > TalosSteps::most) throw nb::value_error(("goals: expected 1 .. " + std::to_string(TalosSteps::most) + " steps").c_str());
    if (first != 0 && first != 1) throw nb::value_error("first: expected 0 (left) or 1 (right)");
    const auto on_ground = [](const double* p) { return Placement{{p[0], p[1], 0.0}, p[2]}; };
    const Placement start[2] = {on_ground(feet.data()), on_ground(feet.data() + 3)};
    Placement goal[TalosSteps::most];
    int swing[TalosSteps::most];
    for (int i = 0; i < n; ++i) {
      goal[i] = on_ground(goals.data() + 3 * i);
      swing[i] = (first + i) % 2;
    }
    switch (steps_.plan(start, n, swing, goal)) {
      case StepsFault::kOverlap: throw nb::value_error("a foot stands on the other one: keep the soles apart");
      case StepsFault::kNoPosture: throw nb::value_error("no posture stands on these feet: they are too far apart, or not finite");
      case StepsFault::kNone: break;
    }
    double x0[nx] = {};
    std::copy_n(steps_.stance(0), nq, x0);
    steps_.pose(x0, h());
  }

  // Postures (n + 1, nq) at rest before the first and after every step.
  Out stances() {
    const int n = steps_.count();
    NewArray q({std::size_t(n + 1), nq});
    for (int i = 0; i <= n; ++i) std::copy_n(steps_.stance(i), nq, q.row(i));
    return q.release();
  }

  // The knot at which each step begins, and the last one.
  std::vector<int> begins() {
    std::vector<int> knot;
    for (int i = 0; i < steps_.count(); ++i) knot.push_back(steps_.begins(i));
    knot.push_back(h().n);
    return knot;
  }

  // Stage one: xs, us, and the largest error of feet and centre of mass.
  nb::dict planned() {
    const double error = steps_.planned(h().x0, s().x, s().u);
    nb::dict result = solution();
    result["error"] = error;
    return result;
  }

  // Stand still at x0; torques carry the weight, or are zero.
  nb::dict cold(bool torques) {
    for (int k = 0; k <= h().n; ++k) std::copy_n(h().x0, nx, s().x[k]);
    for (int k = 0; k < h().n; ++k) {
      std::fill_n(s().u[k], nu, 0.0);
      if (torques) stance_torques<P>(h().x0, h().phase[k], s().u[k]);
    }
    return solution();
  }

  // Velocities and torques along the postures qs (T + 1, nq): of the motion, or of rest in each of them.
  nb::dict along(const In<2>& qs, bool moving) {
    check_shape<2>("qs", qs, {h().n + 1, nq});
    for (int k = 0; k <= h().n; ++k) {
      std::copy_n(qs.data() + k * nq, nq, s().x[k]);
      if (k == 0) std::fill_n(s().x[0] + nq, nv, 0.0);
    }
    steps_.controls(s().x, s().u, moving);
    return solution();
  }

  // Feet (T + 1, 2, 4) as x, y, z, yaw along the postures qs (T + 1, nq), and where the references have them.
  nb::tuple feet(const In<2>& qs) {
    check_shape<2>("qs", qs, {h().n + 1, nq});
    NewArray seen({std::size_t(h().n + 1), 2, 4}), wanted({std::size_t(h().n + 1), 2, 4});
    RbdData<R, double> d;
    for (int k = 0; k <= h().n; ++k) {
      rbd_kinematics<R>(qs.data() + k * nq, d);
      for (int f = 0; f < 2; ++f) {
        Mat3<double> R_WF;
        Vec3<double> p;
        rbd_frame_placement<R>(d, TalosSteps::Contacts::frame[f], R_WF, p);
        const Placement at = steps_.placement(f, k);
        const double row[2][4] = {{p[0], p[1], p[2], std::atan2(R_WF(1, 0), R_WF(0, 0))}, {at.p[0], at.p[1], at.p[2], at.yaw}};
        std::copy_n(row[0], 4, seen.row(k) + 4 * f);
        std::copy_n(row[1], 4, wanted.row(k) + 4 * f);
      }
    }
    return nb::make_tuple(seen.release(), wanted.release());
  }

  // dq (n, nv) = q1 (-) q0, and q0 (+) dq, row by row.
  static Out difference(const In<2>& q0, const In<2>& q1) {
    check_shape<2>("q0", q0, {-1, nq});
    check_shape<2>("q1", q1, {long(q0.shape(0)), nq});
    NewArray dq({q0.shape(0), nv});
    for (std::size_t i = 0; i < q0.shape(0); ++i) rbd_difference<R>(q0.data() + i * nq, q1.data() + i * nq, dq.row(i));
    return dq.release();
  }
  static Out integrate(const In<2>& q0, const In<2>& dq) {
    check_shape<2>("q0", q0, {-1, nq});
    check_shape<2>("dq", dq, {long(q0.shape(0)), nv});
    NewArray q({q0.shape(0), nq});
    for (std::size_t i = 0; i < q0.shape(0); ++i) rbd_integrate<R>(q0.data() + i * nq, dq.data() + i * nv, q.row(i));
    return q.release();
  }

 private:
  static int checked(int between) {
    if (between < 2 || between % 2 != 0 || between > TalosSteps::kBefore + TalosSteps::kAfter)
      throw nb::value_error(("between: expected an even number of knots, 2 .. " + std::to_string(TalosSteps::kBefore + TalosSteps::kAfter)).c_str());
    return between;
  }

  TalosSteps steps_;
};

}  // namespace

void bind_steps(nb::module_& engine) {
  using namespace nb::literals;
  using C = StepProblem;
  nb::class_<C> c(engine, "TalosSteps", "Steps of Talos from rest to rest: call set(feet, goals, first) first, then solve from a guess. cone: weight of wrenches outside "
                      "their cones, between: knots on both feet between two swings, if not the task's.");
  c.def(nb::init<double, int>(), "cone"_a = TalosSteps::Task::weights_cone, "between"_a = TalosSteps::kBetween);
  bind_problem<C>(c);
  c.def("set", &C::set, "feet"_a, "goals"_a, "first"_a,
        "From rest on feet (2, 3), left and right as (x, y, yaw) [m, rad]; step i brings a foot to goals[i] (n, 3), first 0 (left) or 1.")
      .def("stances", &C::stances, "Postures (n + 1, nq) at rest before the first and after every step.")
      .def("begins", &C::begins, "The knot at which each step begins, and the last one: a walk's steps change in the middle of `between`.")
      .def("planned", &C::planned, "Stage one of the data: xs, us along the references by inverse kinematics and dynamics; error [m, rad].")
      .def("cold", &C::cold, "torques"_a = true, "xs, us that stand still at x0, with torques that carry the weight or none.")
      .def("along", &C::along, "qs"_a, "moving"_a = true,
           "xs, us along postures (T + 1, nq) from rest: torques of the motion, or of rest in each posture.")
      .def("feet", &C::feet, "qs"_a, "x, y, z, yaw of the feet (T + 1, 2, 4) along postures (T + 1, nq), and of their references.")
      .def_static("difference", &C::difference, "q0"_a, "q1"_a, "q1 (-) q0 (n, nv) of postures (n, nq).")
      .def_static("integrate", &C::integrate, "q0"_a, "dq"_a, "q0 (+) dq (n, nq).");
  c.attr("knots") = TalosSteps::kKnots;
  c.attr("before") = TalosSteps::kBefore;
  c.attr("between") = TalosSteps::kBetween;
  c.attr("swing") = TalosSteps::kSwing;
  c.attr("most") = TalosSteps::most;
  c.attr("dt") = TalosSteps::Task::dt;
  c.attr("digest") = TalosSteps::Task::digest;
}

}  // namespace engram::binding
