// Robots in Python: rigid-body algorithms over batches of states, one after the other or in lanes.
#include "codegen/binding/engine_rbd.h"

#include "codegen/binding/arrays.h"
#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_derivatives.h"
#include "controller/rbd/rbd_frames.h"
#include "tables/panda/robot.h"
#include "tables/talos/robot.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

namespace engram::binding {
namespace {

using namespace nb::literals;

// Row r of a batch into every lane of `out`; lanes beyond the last row repeat it.
template <class S> void load(const double* rows, int n, int size, int first, S* out) {
  for (int l = 0; l < lanes_of<S>; ++l) {
    const double* row = rows + std::min(first + l, n - 1) * size;
    for (int i = 0; i < size; ++i) set_lane(out[i], l, row[i]);
  }
}

// Lanes of `in` to rows first, first + 1, ... of a batch; those beyond the last row are dropped.
template <class S> void store(const S* in, int size, int n, int first, double* rows) {
  for (int l = 0; l < lanes_of<S> && first + l < n; ++l)
    for (int i = 0; i < size; ++i) rows[(first + l) * size + i] = lane(in[i], l);
}

// Calls f(S{}, first row) over a batch of n: S = double row by row, or S = Pack.
template <class F> void over_batch(int n, bool lanes, F f) {
  nb::gil_scoped_release release;
  if (lanes)
    for (int i = 0; i < n; i += kLanes) f(Pack{}, i);
  else
    for (int i = 0; i < n; ++i) f(double{}, i);
}

template <class R> class Robot {
  static constexpr int nq = R::nq, nv = R::nv;
  using Batch = In<2>;
  template <class S> using Square = Mat<S, nv, nv>;

 public:
  static Out rnea(const Batch& q, const Batch& v, const Batch& a, bool lanes) {
    return vectors(q, v, a, lanes, [](auto* q, auto* v, auto* a, auto& d, auto* out) { rbd_rnea(q, v, a, d, out); });
  }
  static Out aba(const Batch& q, const Batch& v, const Batch& tau, bool lanes) {
    return vectors(q, v, tau, lanes, [](auto* q, auto* v, auto* tau, auto& d, auto* out) { rbd_aba(q, v, tau, d, out); });
  }
  static Out forward_dynamics(const Batch& q, const Batch& v, const Batch& tau, bool lanes) {
    return vectors(q, v, tau, lanes,
                   [](auto* q, auto* v, auto* tau, auto& d, auto* out) { rbd_forward_dynamics(q, v, tau, d, out); });
  }

  static Out crba(const Batch& q, bool lanes) {
    const int n = batch_of("q", q, nq);
    NewArray M({std::size_t(n), nv, nv});
    over_batch(n, lanes, [&](auto scalar, int i) {
      using S = decltype(scalar);
      S x[nq];
      RbdData<R, S> d;
      Square<S> m;
      load(q.data(), n, nq, i, x);
      rbd_kinematics(x, d);
      rbd_crba(d, m);
      store(m.data(), nv * nv, n, i, M.data());
    });
    return M.release();
  }

  static nb::tuple frame_placement(const Batch& q, const std::string& name, bool lanes) {
    const int n = batch_of("q", q, nq), frame = frame_of(name);
    NewArray rotation({std::size_t(n), 3, 3}), origin({std::size_t(n), 3});
    over_batch(n, lanes, [&](auto scalar, int i) {
      using S = decltype(scalar);
      S x[nq];
      RbdData<R, S> d;
      Mat3<S> R_WF;
      Vec3<S> p_WF;
      load(q.data(), n, nq, i, x);
      rbd_kinematics(x, d);
      rbd_frame_placement(d, frame, R_WF, p_WF);
      const Mat<S, 3, 3> rows = R_WF;
      store(rows.data(), 9, n, i, rotation.data());
      store(p_WF.data(), 3, n, i, origin.data());
    });
    return nb::make_tuple(rotation.release(), origin.release());
  }

  static Out frame_jacobian(const Batch& q, const std::string& name, bool lanes) {
    const int n = batch_of("q", q, nq), frame = frame_of(name);
    NewArray jacobian({std::size_t(n), 6, nv});
    over_batch(n, lanes, [&](auto scalar, int i) {
      using S = decltype(scalar);
      S x[nq];
      RbdData<R, S> d;
      Mat3<S> R_WF;
      Vec3<S> p_WF;
      Mat<S, 6, nv> J;
      load(q.data(), n, nq, i, x);
      rbd_kinematics(x, d);
      rbd_frame_placement(d, frame, R_WF, p_WF);
      rbd_frame_jacobian(d, frame, p_WF, J);
      store(J.data(), 6 * nv, n, i, jacobian.data());
    });
    return jacobian.release();
  }

  static nb::tuple rnea_derivatives(const Batch& q, const Batch& v, const Batch& a, bool lanes) {
    const int n = batch_of("q", q, nq);
    same_batch("v", v, n);
    same_batch("a", a, n);
    NewArray dq({std::size_t(n), nv, nv}), dv({std::size_t(n), nv, nv});
    over_batch(n, lanes, [&](auto scalar, int i) {
      using S = decltype(scalar);
      S x[nq], y[nv], z[nv], tau[nv];
      RbdData<R, S> d;
      Square<S> dtau_dq, dtau_dv;
      load(q.data(), n, nq, i, x);
      load(v.data(), n, nv, i, y);
      load(a.data(), n, nv, i, z);
      rbd_rnea(x, y, z, d, tau);
      rbd_composite_inertias(d);
      rbd_rnea_derivatives(d, dtau_dq, dtau_dv);
      store(dtau_dq.data(), nv * nv, n, i, dq.data());
      store(dtau_dv.data(), nv * nv, n, i, dv.data());
    });
    return nb::make_tuple(dq.release(), dv.release());
  }

  static nb::tuple forward_derivatives(const Batch& q, const Batch& v, const Batch& tau, bool lanes) {
    const int n = batch_of("q", q, nq);
    same_batch("v", v, n);
    same_batch("tau", tau, n);
    NewArray dq({std::size_t(n), nv, nv}), dv({std::size_t(n), nv, nv}), dtau({std::size_t(n), nv, nv});
    over_batch(n, lanes, [&](auto scalar, int i) {
      using S = decltype(scalar);
      S x[nq], y[nv], z[nv], a[nv];
      RbdData<R, S> d;
      Square<S> da_dq, da_dv, Minv;
      load(q.data(), n, nq, i, x);
      load(v.data(), n, nv, i, y);
      load(tau.data(), n, nv, i, z);
      rbd_forward_dynamics(x, y, z, d, a);
      rbd_forward_derivatives(d, a, da_dq, da_dv, Minv);
      store(da_dq.data(), nv * nv, n, i, dq.data());
      store(da_dv.data(), nv * nv, n, i, dv.data());
      store(Minv.data(), nv * nv, n, i, dtau.data());
    });
    return nb::make_tuple(dq.release(), dv.release(), dtau.release());
  }

  static void bind(nb::module_& engine) {
    nb::module_ m = engine.def_submodule(R::name,
                                         "Rigid-body algorithms of this robot over batches; SI units, conventions of "
                                         "docs/architecture.md. lanes=True computes several states side by side.");
    m.attr("name") = R::name;
    m.attr("digest") = R::digest;
    m.attr("nj") = R::nj;
    m.attr("nq") = nq;
    m.attr("nv") = nv;
    m.attr("nu") = R::nu;
    m.attr("frames") = std::vector<std::string>(R::frame_name, R::frame_name + R::nframe);
    m.attr("q_home") = constants(R::q_home, nq);
    m.attr("q_lo") = constants(R::q_lo, nq);
    m.attr("q_hi") = constants(R::q_hi, nq);
    m.attr("v_max") = constants(R::v_max, nv);
    m.attr("u_max") = constants(R::u_max, R::nu);
    m.def("rnea", rnea, "q"_a, "v"_a, "a"_a, "lanes"_a = false, "Joint forces (n, nv) of q (n, nq), v, a (n, nv).");
    m.def("aba", aba, "q"_a, "v"_a, "tau"_a, "lanes"_a = false, "Accelerations (n, nv) by the articulated body algorithm.");
    m.def("forward_dynamics", forward_dynamics, "q"_a, "v"_a, "tau"_a, "lanes"_a = false,
          "Accelerations (n, nv) by M^-1 (tau - b): the solver's own.");
    m.def("crba", crba, "q"_a, "lanes"_a = false, "Mass matrices (n, nv, nv), armature included.");
    m.def("frame_placement", frame_placement, "q"_a, "frame"_a, "lanes"_a = false,
          "R_WF (n, 3, 3) and p_WF (n, 3) of a named frame.");
    m.def("frame_jacobian", frame_jacobian, "q"_a, "frame"_a, "lanes"_a = false,
          "Jacobians (n, 6, nv) of a named frame: velocity of its origin, then angular velocity, in world axes.");
    m.def("rnea_derivatives", rnea_derivatives, "q"_a, "v"_a, "a"_a, "lanes"_a = false,
          "d tau / d q and d tau / d v (n, nv, nv).");
    m.def("forward_derivatives", forward_derivatives, "q"_a, "v"_a, "tau"_a, "lanes"_a = false,
          "d a / d q, d a / d v and d a / d tau = M^-1 (n, nv, nv).");
  }

 private:
  static int batch_of(const char* name, const Batch& rows, int size) {
    check_shape<2>(name, rows, {-1, size});
    return int(rows.shape(0));
  }
  static void same_batch(const char* name, const Batch& rows, int n) { check_shape<2>(name, rows, {n, nv}); }

  static int frame_of(const std::string& name) {
    const auto* end = R::frame_name + R::nframe;
    const auto* found = std::find(R::frame_name, end, name);
    if (found == end) throw nb::value_error((std::string(R::name) + " has no frame '" + name + "'").c_str());
    return int(found - R::frame_name);
  }

  static Out constants(const double* values, int n) {
    NewArray array({std::size_t(n)});
    std::copy_n(values, n, array.data());
    return array.release();
  }

  // out = f(q, v, w) for each state
  template <class F> static Out vectors(const Batch& q, const Batch& v, const Batch& w, bool lanes, F f) {
    const int n = batch_of("q", q, nq);
    same_batch("v", v, n);
    same_batch("third argument", w, n);
    NewArray result({std::size_t(n), nv});
    over_batch(n, lanes, [&](auto scalar, int i) {
      using S = decltype(scalar);
      S x[nq], y[nv], z[nv], out[nv];
      RbdData<R, S> d;
      load(q.data(), n, nq, i, x);
      load(v.data(), n, nv, i, y);
      load(w.data(), n, nv, i, z);
      f(x, y, z, d, out);
      store(out, nv, n, i, result.data());
    });
    return result.release();
  }
};

}  // namespace

void bind_robots(nb::module_& engine) {
  Robot<robots::Panda>::bind(engine);
  Robot<robots::Talos>::bind(engine);
}

}  // namespace engram::binding
