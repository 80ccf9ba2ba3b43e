// The reach tasks in Python: problem, guesses, clearance, and the hard-constrained program.
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/problem.h"
#include "controller/ik/ik_pose.h"
#include "controller/memory/memory_warp.h"
#include "controller/ocp/ocp_reach.h"
#include "tables/panda_reach/task.h"

#include <limits>

namespace engram::binding {
namespace {

template <class Task> class ReachProblem : public Problem<Reach<Task>, Task::nknots> {
  using Base = Problem<Reach<Task>, Task::nknots>;
  using Base::h;
  using Base::s;
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots, nq = R::nq;

 public:
  using Base::nu, Base::nv, Base::nx;

  ReachProblem() {
    for (int k = 0; k <= N; ++k) t_[k] = k * Task::dt;
  }

  // From the state x0 (nx) to the task (target pose), which changed since_jump seconds before the first knot.
  void set(const In<1>& x0, const In<1>& task, double since_jump) {
    const ReachTarget target = target_of(task);
    this->set_x0(x0);
    h().n = N;
    for (int k = 0; k <= N; ++k) reach_knot<Task>(target, k < N ? Task::dt : 0.0, since_jump + t_[k], h().knot[k]);
  }

  // Stand still at the first posture under the gravity torque: the cold start.
  nb::dict hold() {
    RbdData<R, double> d;
    double g[nv];
    rbd_kinematics(h().x0, d);
    rbd_gravity(d, g);
    for (int k = 0; k <= N; ++k)
      for (int i = 0; i < nx; ++i) s().x[k][i] = i < nq ? h().x0[i] : 0.0;
    for (int k = 0; k < N; ++k) std::copy_n(g + nv - nu, nu, s().u[k]);
    return this->solution();
  }

  // Motions xs (m, N + 1, nx), us (m, N, nu) along the paths (m, N + 1, nq) bent to start at x0 and to end at the goals (m, nq).
  nb::tuple warp(const In<3>& paths, const In<2>& goals) {
    const std::size_t m = paths.shape(0);
    check_shape<3>("paths", paths, {-1, N + 1, nq});
    check_shape<2>("goals", goals, {long(m), nq});
    NewArray xs({m, N + 1, nx}), us({m, N, nu});
    for (std::size_t i = 0; i < m; ++i) bend(paths.data() + i * (N + 1) * nq, goals.data() + i * nq, xs.row(i), us.row(i));
    return nb::make_tuple(xs.release(), us.release());
  }

  // The same for minimum-jerk straight lines in joint space.
  nb::tuple line(const In<2>& goals) {
    check_shape<2>("goals", goals, {-1, nq});
    const std::size_t m = goals.shape(0);
    NewArray xs({m, N + 1, nx}), us({m, N, nu});
    std::vector<double> still((N + 1) * nq);
    for (int k = 0; k <= N; ++k) std::copy_n(h().x0, nq, &still[k * nq]);
    for (std::size_t i = 0; i < m; ++i) bend(still.data(), goals.data() + i * nq, xs.row(i), us.row(i));
    return nb::make_tuple(xs.release(), us.release());
  }

  // Postures q (m, nq) that inverse kinematics finds for a task from the starts (m, nq), and their errors (m).
  static nb::tuple ik(const In<1>& task, const In<2>& starts) {
    check_shape<2>("starts", starts, {-1, nq});
    const ReachTarget target = target_of(task);
    const int m = int(starts.shape(0));
    NewArray q({std::size_t(m), nq}), error({std::size_t(m)});
    over_rows(m, starts.data(), [&](Pack(&lanes)[nq], auto store) {
      RbdData<R, Pack> d;
      const Pack e = ik_pose<R, Task::frame>(target, lanes, d);
      store(lanes, nq, q.data());
      store(&e, 1, error.data());
    });
    return nb::make_tuple(q.release(), error.release());
  }

  // Smallest distance between robot and boxes at each posture.
  static Out clearance(const In<2>& q) {
    check_shape<2>("q", q, {-1, nq});
    const int n = int(q.shape(0));
    NewArray distance({std::size_t(n)});
    over_rows(n, q.data(), [&](Pack(&lanes)[nq], auto store) {
      const Pack d = reach_clearance<Task>(lanes);
      store(&d, 1, distance.data());
    });
    return distance.release();
  }

  // How far the hand is from the pose of a task at each posture: (n, 2), [m] and [rad].
  static Out error(const In<2>& q, const In<1>& task) {
    check_shape<2>("q", q, {-1, nq});
    const ReachTarget target = target_of(task);
    const std::size_t n = q.shape(0);
    NewArray error({n, 2});
    for (std::size_t i = 0; i < n; ++i) {
      Mat3<double> R_WH, R_WT;
      Vec3<double> p_WH;
      reach_hand<Task>(q.data() + i * nq, R_WH, p_WH);
      for (int e = 0; e < 9; ++e) R_WT(e / 3, e % 3) = target.R[e];
      error.row(i)[0] = (p_WH - Vec3<double>(target.p[0], target.p[1], target.p[2])).norm();
      error.row(i)[1] = log3<double>(R_WT.transpose() * R_WH).norm();
    }
    return error.release();
  }

  // The same costs under hard bounds. `clearance` is kept from every box at every knot (none if not finite).
  nb::dict ipopt(const In<2>& xs, const In<2>& us, bool limits, bool torque_box, double clearance, int iterations,
                 double tolerance, bool limited_memory) {
    offline::IpoptOptions options;
    options.iterations = iterations;
    options.tolerance = tolerance;
    options.limited_memory = limited_memory;
    offline::StateBounds<Reach<Task>> bounds;
    bounds.control_box = torque_box;
    for (int i = 0; limits && i < nq; ++i) {
      bounds.x_lo[i] = R::q_lo[i];
      bounds.x_hi[i] = R::q_hi[i];
      bounds.x_lo[nq + i] = -R::v_max[i];
      bounds.x_hi[nq + i] = R::v_max[i];
    }
    offline::PathConstraint path;
    if (std::isfinite(clearance)) {
      path.count = R::nsphere * Task::nbox;
      path.evaluate = [clearance](const double* q, double* g, double* dg) { distances(q, clearance, g, dg); };
    }
    return this->solve_nlp(xs, us, options, bounds, path);
  }

 private:
  static ReachTarget target_of(const In<1>& task) {
    check_shape<1>("task", task, {Task::ntask});
    ReachTarget target;
    if (!reach_target(task.data(), target)) throw nb::value_error("task: not finite, or its quaternion is zero");
    return target;
  }

  // Calls f(lanes, store) for the postures of a batch, kLanes at a time; store(values, size, rows) puts the lanes into rows.
  template <class F> static void over_rows(int n, const double* q, F f) {
    for (int first = 0; first < n; first += kLanes) {
      Pack lanes[nq];
      for (int l = 0; l < kLanes; ++l)
        for (int i = 0; i < nq; ++i) lanes[i].l[l] = q[std::min(first + l, n - 1) * nq + i];
      f(lanes, [&](const Pack* values, int size, double* rows) {
        for (int l = 0; l < kLanes && first + l < n; ++l)
          for (int i = 0; i < size; ++i) rows[(first + l) * size + i] = values[i].l[l];
      });
    }
  }

  void bend(const double* path, const double* goal, double* xs, double* us) {
    double q[N + 1][nq];  // the path's bow: what it deviates from the straight line between its ends
    for (int k = 0; k <= N; ++k) {
      const Blend blend(t_[k] / t_[N]);
      for (int i = 0; i < nq; ++i) q[k][i] = path[k * nq + i] - (1 - blend.s) * path[i] - blend.s * path[N * nq + i];
    }
    RbdData<R, double> d;
    warp_bow<R>(h().x0, goal, N, t_, t_[N], q);
    follow_path<R>(h().x0 + nq, N, t_, q, d, [&](int k, const double* qk, const double* vk, const double* uk) {
      std::copy_n(qk, nq, xs + k * nx);
      std::copy_n(vk, nv, xs + k * nx + nq);
      if (uk) std::copy_n(uk + nv - nu, nu, us + k * nu);
    });
  }

  // g = distance of every sphere to every box, less what is asked; dg (pairs x nv)
  static void distances(const double* q, double asked, double* g, double* dg) {
    RbdData<R, double> d;
    Mat<double, 3, nv> J;
    rbd_kinematics(q, d);
    for (int sphere = 0; sphere < R::nsphere; ++sphere) {
      const Vec3<double> center = rbd_sphere_position(d, sphere);
      rbd_point_jacobian(d, R::sphere_joint[sphere], center, J);
      for (int box = 0; box < Task::nbox; ++box) {
        Vec3<double> gradient;
        *g++ = BoxField<Task>::distance(box, center, gradient) - R::sphere_radius[sphere] - asked;
        for (int i = 0; i < nv; ++i) *dg++ = gradient.dot(J.col(i));
      }
    }
  }

  double t_[N + 1];
};

template <class Task> void bind_task(nb::module_& engine, const char* name) {
  using namespace nb::literals;
  using C = ReachProblem<Task>;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  nb::class_<C> c(engine, name, "A reach task: call set(x0, task) first, then solve from a guess.");
  c.def(nb::init<>());
  bind_problem<C>(c);
  c.def("set", &C::set, "x0"_a, "task"_a, "since_jump"_a = 0.0,
        "From the state x0 (nx) to the task vector, which changed since_jump [s] before the first knot.")
      .def("hold", &C::hold, "The cold start: xs, us that stand still at the first posture under the gravity torque.")
      .def("line", &C::line, "goals"_a,
           "xs (m, T + 1, nx), us (m, T, nu) of minimum-jerk straight lines in joint space to goals (m, nq).")
      .def("warp", &C::warp, "paths"_a, "goals"_a, "The same for remembered paths (m, T + 1, nq), bent to x0 and to the goals.")
      .def_static(
          "ik", &C::ik, "task"_a, "starts"_a,
          "Postures (m, nq) that reach the task's pose, from the starts (m, nq), and what is left of the error (m) [m, rad].")
      .def_static("clearance", &C::clearance, "q"_a, "Smallest distance [m] between robot and boxes at each posture (n, nq).")
      .def_static("error", &C::error, "q"_a, "task"_a,
                  "Distance of the hand to a task's pose (n, 2) [m, rad] at each posture (n, nq).")
      .def("ipopt", &C::ipopt, "xs"_a, "us"_a, "limits"_a = true, "torque_box"_a = true, "clearance"_a = -infinity,
           "iterations"_a = 500, "tolerance"_a = 1e-8, "limited_memory"_a = false,
           "The same costs under hard limits of joints, speeds and torques, and a hard clearance [m] (-inf: none), by Ipopt.");
  c.attr("digest") = Task::digest;
  c.attr("dt") = Task::dt;
  c.attr("ntask") = Task::ntask;
  c.attr("success_position") = Task::success_position;
  c.attr("success_rotation") = Task::success_rotation;
}

}  // namespace

void bind_reach(nb::module_& engine) { bind_task<tasks::PandaReach>(engine, "PandaReach"); }

}  // namespace engram::binding
