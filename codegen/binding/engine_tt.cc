// Tensor trains in Python: the deployed evaluator and sampler, on a table that is still arrays (engram.emit.kinds.Tt).
#include "codegen/binding/arrays.h"
#include "codegen/binding/engine_problems.h"
#include "controller/tab/tab_tt.h"

#include <nanobind/stl/string.h>

#include <cstdlib>
#include <cstring>

namespace engram::binding {
namespace {

class TensorTrain {
 public:
  TensorTrain(const nb::object& source, int capacity) {
    TabHead& head = table_.head;
    head.schema = TAB_SCHEMA;
    head.kind = kTabTt;
    head.name = "tensor train";
    head.nin = int(nb::cast<nb::list>(source.attr("inputs")).size());
    head.nout = 1;
    std::size_t bytes = 0, at = 0;
    const nb::list arrays(source.attr("arrays")());
    const auto words = [](nb::handle item) {
      return nb::cast<nb::ndarray<const uint32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>>(item.attr("words"));
    };
    const auto padded = [](std::size_t n) { return (n + 63) / 64 * 64; };
    for (nb::handle item : arrays) bytes += padded(4 * words(item).size());
    data_.reset(static_cast<char*>(std::aligned_alloc(64, bytes)));
    for (nb::handle item : arrays) {
      const auto array = words(item);
      std::memcpy(data_.get() + at, array.data(), 4 * array.size());
      head.array[head.narray++] = {"", data_.get() + at, array.size()};
      at += padded(4 * array.size());
    }
    head.digest = tab_digest(&head);
    const nb::object fields = source.attr("fields")();
    table_.d = nb::cast<int>(fields["d"]);
    table_.type = nb::cast<int>(fields["type"]);
    table_.shape = static_cast<const float*>(head.array[2].data);
    table_.scale = static_cast<const float*>(head.array[3].data);
    table_.core = head.array[4].data;
    char text[TAB_TEXT];
    if (tab_check(&head, kTabTt, 0, 0, text) != kTabOk) throw nb::value_error(text);
    if (capacity < 1) throw nb::value_error("capacity: at least 1");
    const int64_t size = tab_tt_sampler_bytes(&table_, capacity);
    memory_.reset(static_cast<char*>(std::aligned_alloc(64, padded(size))));
    (void)tab_tt_init(&sampler_, &table_, capacity, memory_.get(), size);
  }

  nb::tuple value(const In<2>& x) {
    check_shape<2>("x", x, {-1, table_.d});
    const std::size_t m = x.shape(0), d = table_.d;
    NewArray value({m}), gradient({m, d});
    nb::list statuses;
    for (std::size_t i = 0; i < m; ++i)
      statuses.append(int(tab_tt_value(&table_, x.data() + i * d, value.row(i), gradient.row(i))));
    return nb::make_tuple(value.release(), gradient.release(), statuses);
  }

  int condition(const In<1>& x, const nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>& fixed) {
    check_shape<1>("x", x, {table_.d});
    if (long(fixed.shape(0)) != table_.d) throw nb::value_error("fixed: as many as there are variables");
    return tab_tt_condition(&sampler_, x.data(), fixed.data());
  }

  nb::tuple sample(double alpha, int count, uint64_t seed) {
    if (count < 1 || count > sampler_.capacity) throw nb::value_error("count: 1 .. capacity");
    NewArray x({std::size_t(count), std::size_t(table_.d)}), log_prob({std::size_t(count)});
    if (tab_tt_sample(&sampler_, alpha, count, seed, x.data(), log_prob.data()) != kTabOk) throw nb::value_error("alpha: not a number");
    return nb::make_tuple(x.release(), log_prob.release());
  }

  int64_t bytes() const {
    int64_t words = 0;
    for (int i = 0; i < table_.head.narray; ++i) words += table_.head.array[i].count;
    return 4 * words;
  }
  int64_t sampler_bytes() const { return tab_tt_sampler_bytes(&table_, sampler_.capacity); }

  const TabTt& table() const { return table_; }
  TabTtSampler& sampler() { return sampler_; }

 private:
  struct Free {
    void operator()(char* p) const { std::free(p); }
  };
  TabTt table_{};
  TabTtSampler sampler_{};
  std::unique_ptr<char, Free> data_, memory_;
};

}  // namespace

void bind_tensor_train(nb::module_& engine) {
  using namespace nb::literals;
  nb::class_<TensorTrain>(engine, "TensorTrain", "controller/tab's tensor train on a table of engram.emit.kinds.Tt.")
      .def(nb::init<const nb::object&, int>(), "table"_a, "capacity"_a = 1000)
      .def("value", &TensorTrain::value, "x"_a, "(density (m), gradient (m, d), status (m)) at x (m, d).")
      .def("condition", &TensorTrain::condition, "x"_a, "fixed"_a, "Conditions on the variables that are fixed; the status.")
      .def("sample", &TensorTrain::sample, "alpha"_a, "count"_a, "seed"_a = 1, "(x (count, d), log probability (count)).")
      .def_prop_ro("bytes", &TensorTrain::bytes, "Bytes of the table's arrays.")
      .def_prop_ro("sampler_bytes", &TensorTrain::sampler_bytes, "Bytes of the sampler's memory.");
}

}  // namespace engram::binding
