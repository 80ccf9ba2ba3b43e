// Tables in Python: any kind of engram.emit.kinds, asked through the controller's own evaluators.
#include "codegen/binding/arrays.h"
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/held_table.h"
#include "codegen/binding/thread_clock.h"
#include "controller/tab/tab_eval.h"
#include "controller/tab/tab_gmr.h"
#include "controller/tab/tab_mlp.h"
#include "controller/tab/tab_sdf.h"

#include <nanobind/stl/optional.h>

#include <functional>
#include <optional>

namespace engram::binding {
namespace {

using Floats = std::vector<float>;

// Time [us] of reading `bytes` once, n samples over the same memory: what no query of a table of that size can beat.
NewArray read_us(std::size_t bytes, std::size_t n) {
  constexpr int kWidth = 4 * TAB_LANES, kRepeat = 16;  // numbers side by side; readings in a sample, against the clock's own time
  const Floats memory(bytes / sizeof(float) / kWidth * kWidth + kWidth, 1.0f);
  NewArray us({n});
  for (std::size_t sample = 0; sample < n; ++sample) {
    const double start = thread_us();
    for (int pass = 0; pass < kRepeat; ++pass) {
      float sum[kWidth] = {};
      for (std::size_t i = 0; i < memory.size(); i += kWidth)
        for (int j = 0; j < kWidth; ++j) sum[j] += memory[i + j];
      asm volatile("" : : "g"(sum) : "memory");
    }
    us.data()[sample] = (thread_us() - start) / kRepeat;
  }
  return us;
}

// Calls of the allocators within timed queries so far; none if nobody counts. With `planted`, after one `new` and `delete` more.
std::optional<long long> allocations(bool planted) {
  if (!engram_count_heap) return {};
  if (planted) timed_us([] {
    int* volatile number = new int(1);
    delete number;
  });
  return engram_count_heap(false);
}

class Table {
 public:
  explicit Table(const nb::object& source) : held_(source, 0, 0), pad_(tab_pad(held_.head()->nout)) {
    char text[TAB_TEXT];
    if (tab_check(held_.head(), TabKind(held_.head()->kind), 0, 0, text) != kTabOk) throw nb::value_error(text);
  }

  // Answers to every row of X: status (n), index and weight (n, count), y and var (n, count, nout)
  nb::dict answers(const In<2>& X, int count) {
    const TabHead* head = checked(X);
    if (count < 1 || count > TAB_MAX_ANSWERS) throw nb::value_error("count: out of range");
    const std::size_t n = X.shape(0), k = count, m = head->nout;
    NewArray status({n}), index({n, k}), weight({n, k}), y({n, k, m}), var({n, k, m});
    std::vector<int32_t> index_(k);
    Floats weight_(k), y_(k * pad_), var_(k * pad_);
    for (std::size_t row = 0; row < n; ++row) {
      status.data()[row] = tab_answers(head, X.data() + row * head->nin, count, index_.data(), weight_.data(), y_.data(), var_.data());
      for (std::size_t i = 0; i < k; ++i) {
        index.row(row)[i] = index_[i];
        weight.row(row)[i] = weight_[i];
        for (std::size_t j = 0; j < m; ++j) {
          y.row(row)[i * m + j] = y_[i * pad_ + j];
          var.row(row)[i * m + j] = var_[i * pad_ + j];
        }
      }
    }
    nb::dict result;
    result["status"] = status.release();
    result["index"] = index.release();
    result["weight"] = weight.release();
    result["y"] = y.release();
    result["var"] = var.release();
    return result;
  }

  // Moment matching of GMR and MLP: mean and var (n, nout)
  nb::tuple moments(const In<2>& X) {
    const TabHead* head = checked(X);
    if (head->kind != kTabGmr && head->kind != kTabMlp) throw nb::value_error("this kind of table has no moments");
    return rows(X, head->nout, [this, head](const double* x, float* mean, float* var) {
      return head->kind == kTabGmr ? tab_gmr_moments(held_.as<TabGmr>(), x, mean, var) : tab_mlp_moments(held_.as<TabMlp>(), x, mean, var);
    });
  }

  // Distance (n, 1) and gradient (n, 3) of an SDF
  nb::tuple distance(const In<2>& X) {
    if (checked(X)->kind != kTabSdf) throw nb::value_error("this kind of table has no distances");
    return rows(X, 3, [this](const double* x, float* d, float* g) { return tab_sdf_eval(held_.as<TabSdf>(), x, d, g); });
  }

  // Processor time of a query [us]: each row of X once, `count` answers
  NewArray time_us(const In<2>& X, int count) {
    const TabHead* head = checked(X);
    const std::size_t n = X.shape(0);
    NewArray us({n});
    std::vector<int32_t> index(count);
    Floats weight(count), y(count * pad_);
    for (std::size_t row = 0; row < n; ++row) {
      us.data()[row] = timed_us(
          [&] { tab_answers(head, X.data() + row * head->nin, count, index.data(), weight.data(), y.data(), nullptr); });
    }
    return us;
  }

 private:
  const TabHead* checked(const In<2>& X) const {
    check_shape<2>("X", X, {-1, held_.head()->nin});
    return held_.head();
  }

  // Two outputs of m numbers for every row of X
  nb::tuple rows(const In<2>& X, std::size_t m, const std::function<TabStatus(const double*, float*, float*)>& query) {
    const std::size_t n = X.shape(0);
    NewArray first({n, m}), second({n, m});
    Floats a(pad_ + 3), b(pad_ + 3);
    for (std::size_t row = 0; row < n; ++row) {
      query(X.data() + row * X.shape(1), a.data(), b.data());
      for (std::size_t j = 0; j < m; ++j) {
        first.row(row)[j] = a[j];
        second.row(row)[j] = b[j];
      }
    }
    return nb::make_tuple(first.release(), second.release());
  }

  HeldTable held_;
  std::size_t pad_;
};

}  // namespace

void bind_tables(nb::module_& engine) {
  using namespace nb::literals;
  nb::class_<Table>(engine, "Table", "A table of engram.emit.kinds, asked through the controller's evaluator.")
      .def(nb::init<const nb::object&>(), "table"_a)
      .def("answers", &Table::answers, "X"_a, "count"_a = 1,
           "The best answers to each row of X (n, nin): status (n), index, weight (n, count), y, var (n, count, nout).")
      .def("moments", &Table::moments, "X"_a, "Mean and variance (n, nout) of a mixture or an ensemble.")
      .def("distance", &Table::distance, "X"_a, "Distance (n, 3, in the first column) and gradient (n, 3) of a signed distance.")
      .def("time_us", [](Table& t, const In<2>& X, int count) { return t.time_us(X, count).release(); }, "X"_a, "count"_a = 1,
           "Processor time of each query [us].");
  engine.def("read_us", [](std::size_t bytes, std::size_t n) { return read_us(bytes, n).release(); }, "bytes"_a, "n"_a,
             "Processor time [us] of reading that many bytes, n samples over the same memory.");
  engine.def("allocations", &allocations, "planted"_a = false,
             "Calls of the allocators within timed queries so far, None if bench/count_heap.cc is not loaded; planted: after a new and a delete.");
}

}  // namespace engram::binding
