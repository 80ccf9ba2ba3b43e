// Tensor trains in Python: the deployed evaluator and sampler, on a table that is still arrays (engram.emit.kinds.Tt).
#include "codegen/binding/arrays.h"
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/held_table.h"
#include "codegen/binding/thread_clock.h"
#include "controller/tab/tab_tt.h"

#include <cstdlib>
#include <vector>

namespace engram::binding {
namespace {

class TensorTrain {
 public:
  TensorTrain(const nb::object& source, int capacity) : held_(source, 0, 0), tab_(held_.as<TabTt>()) {
    char text[TAB_TEXT];
    if (tab_check(&tab_->head, kTabTt, 0, 0, text) != kTabOk) throw nb::value_error(text);
    if (capacity < 1) throw nb::value_error("capacity: at least 1");
    const int64_t size = tab_tt_sampler_bytes(tab_, capacity);
    memory_.reset(static_cast<char*>(std::aligned_alloc(64, std::size_t(size + 63) / 64 * 64)));
    (void)tab_tt_init(&sampler_, tab_, capacity, memory_.get(), size);
  }

  nb::tuple value(const In<2>& x) {
    check_shape<2>("x", x, {-1, tab_->d});
    const std::size_t m = x.shape(0), d = tab_->d;
    NewArray value({m}), gradient({m, d});
    nb::list statuses;
    for (std::size_t i = 0; i < m; ++i)
      statuses.append(int(tab_tt_value(tab_, x.data() + i * d, value.row(i), gradient.row(i))));
    return nb::make_tuple(value.release(), gradient.release(), statuses);
  }

  nb::tuple distance(const In<2>& p) {
    check_shape<2>("p", p, {-1, 3});
    if (tab_->d != 3) throw nb::value_error("a distance is a train over x, y, z");
    const std::size_t m = p.shape(0);
    NewArray distance({m}), gradient({m, 3});
    nb::list statuses;
    for (std::size_t i = 0; i < m; ++i) {
      float d, g[3];
      statuses.append(int(tab_tt_distance(tab_, p.data() + i * 3, &d, g)));
      distance.data()[i] = d;
      for (int j = 0; j < 3; ++j) gradient.row(i)[j] = g[j];
    }
    return nb::make_tuple(distance.release(), gradient.release(), statuses);
  }

  int condition(const In<1>& x, const nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>& fixed) {
    check_shape<1>("x", x, {tab_->d});
    if (long(fixed.shape(0)) != tab_->d) throw nb::value_error("fixed: as many as there are variables");
    return tab_tt_condition(&sampler_, x.data(), fixed.data());
  }

  nb::tuple sample(double alpha, int count, uint64_t seed) {
    if (count < 1 || count > sampler_.capacity) throw nb::value_error("count: 1 .. capacity");
    NewArray x({std::size_t(count), std::size_t(tab_->d)}), log_prob({std::size_t(count)});
    if (tab_tt_sample(&sampler_, alpha, count, seed, x.data(), log_prob.data()) != kTabOk) throw nb::value_error("alpha: not a number");
    return nb::make_tuple(x.release(), log_prob.release());
  }

  // Processor time of a call that draws `count` samples [us], `repeats` times: every call has a seed of its own, and the clock is read
  // around `calls` of them, which share what that costs.
  NewArray time_us(double alpha, int count, std::size_t repeats, std::size_t calls) {
    if (count < 1 || count > sampler_.capacity) throw nb::value_error("count: 1 .. capacity");
    if (calls < 1) throw nb::value_error("calls: at least 1");
    std::vector<double> x(std::size_t(count) * tab_->d);
    NewArray us({repeats});
    uint64_t seed = 0;
    for (std::size_t i = 0; i < repeats; ++i)
      us.data()[i] = timed_us([&] {
        for (std::size_t j = 0; j < calls; ++j) (void)tab_tt_sample(&sampler_, alpha, count, seed++, x.data(), nullptr);
      }) / double(calls);
    return us;
  }

  int64_t bytes() const {
    int64_t words = 0;
    for (int i = 0; i < tab_->head.narray; ++i) words += tab_->head.array[i].count;
    return 4 * words;
  }
  int64_t sampler_bytes() const { return tab_tt_sampler_bytes(tab_, sampler_.capacity); }

 private:
  struct Free {
    void operator()(char* p) const { std::free(p); }
  };
  HeldTable held_;
  const TabTt* tab_;
  TabTtSampler sampler_{};
  std::unique_ptr<char, Free> memory_;
};

}  // namespace

void bind_tensor_train(nb::module_& engine) {
  using namespace nb::literals;
  nb::class_<TensorTrain>(engine, "TensorTrain", "controller/tab's tensor train on a table of engram.emit.kinds.Tt.")
      .def(nb::init<const nb::object&, int>(), "table"_a, "capacity"_a = 1000)
      .def("value", &TensorTrain::value, "x"_a, "(density (m), gradient (m, d), status (m)) at x (m, d).")
      .def("distance", &TensorTrain::distance, "p"_a, "(signed distance (m), gradient (m, 3), status (m)) of a train over x, y, z.")
      .def("condition", &TensorTrain::condition, "x"_a, "fixed"_a, "Conditions on the variables that are fixed; the status.")
      .def("sample", &TensorTrain::sample, "alpha"_a, "count"_a, "seed"_a = 1, "(x (count, d), log probability (count)).")
      .def("time_us",
           [](TensorTrain& t, double alpha, int count, std::size_t repeats, std::size_t calls) {
             return t.time_us(alpha, count, repeats, calls).release();
           },
           "alpha"_a, "count"_a, "repeats"_a, "calls"_a = 1,
           "Processor time of a call that draws `count` samples [us], each the mean of `calls` one after the other.")
      .def_prop_ro("bytes", &TensorTrain::bytes, "Bytes of the table's arrays.")
      .def_prop_ro("sampler_bytes", &TensorTrain::sampler_bytes, "Bytes of the sampler's memory.");
}

}  // namespace engram::binding
