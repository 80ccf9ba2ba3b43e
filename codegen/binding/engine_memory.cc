// The memory in Python: the deployed query, on tables that are still arrays (engram.emit.kinds), so that a fit can be judged and its
// trust calibrated before anything is written.
#include "codegen/binding/arrays.h"
#include "codegen/binding/engine_problems.h"
#include "controller/memory/memory_check.h"
#include "controller/memory/memory_query.h"
#include "tables/panda_reach/task.h"

#include <nanobind/stl/string.h>

#include <algorithm>
#include <deque>

namespace engram::binding {
namespace {

// A table struct filled from an engram.emit.kinds.Table; owns the arrays.
template <class Tab> struct HeldTable {
  Tab table{};
  std::string name;
  std::deque<std::vector<float>> arrays;  // deque: growing moves nothing

  HeldTable(const nb::object& source, TabKind kind, uint64_t robot_digest, uint64_t task_digest) {
    TabHead& head = table.head;
    name = nb::cast<std::string>(source.attr("role"));
    head.schema = TAB_SCHEMA;
    head.kind = kind;
    head.name = name.c_str();
    head.robot_digest = robot_digest;
    head.task_digest = task_digest;
    head.nin = int(nb::cast<nb::list>(source.attr("inputs")).size());
    head.nout = nb::cast<int>(source.attr("outputs"));
    for (nb::handle item : source.attr("arrays")()) {
      const auto flat = nb::cast<nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>>(item.attr("flat"));
      arrays.emplace_back(flat.data(), flat.data() + flat.size());
      if (head.narray == TAB_ARRAYS) throw nb::value_error("too many arrays in a table");
      head.array[head.narray++] = {"", arrays.back().data(), arrays.back().size()};
    }
    head.digest = tab_digest(&head);
    const nb::object fields = source.attr("fields")();
    const auto integer = [&fields](const char* key) { return nb::cast<int>(fields[key]); };
    const auto number = [&fields](const char* key) { return nb::cast<float>(nb::float_(fields[key])); };
    const auto array = [&head](int i) { return static_cast<const float*>(head.array[i].data); };
    if constexpr (std::is_same_v<Tab, TabKnn>) {
      table.n = integer("n"), table.d = integer("d"), table.m = integer("m");
      table.scale = array(2), table.x = array(3), table.value = array(4);
    } else if constexpr (std::is_same_v<Tab, TabGpr>) {
      table.n = integer("n"), table.d = integer("d"), table.m = integer("m");
      table.variance = number("variance"), table.noise = number("noise");
      table.inv_length = array(2), table.x = array(3), table.alpha = array(4), table.mean = array(5), table.linv = array(6);
    } else if constexpr (std::is_same_v<Tab, TabPca>) {
      table.m = integer("m"), table.n = integer("n");
      table.mean = array(2), table.basis = array(3);
    } else if constexpr (std::is_same_v<Tab, TabRbf>) {
      table.k = integer("k"), table.nchannel = integer("nchannel"), table.width = number("width");
      table.center = array(2);
    } else {
      table.d = integer("d"), table.bias = number("bias");
      table.weight = array(2);
    }
  }
};

template <class Task> class Memory {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots, nx = R::nq + R::nv, nu = R::nu;

 public:
  Memory(const nb::object& knn, const nb::object& gpr, const nb::object& bow, const nb::object& time, const nb::object& trust)
      : knn_(knn, kTabKnn, R::digest, Task::digest),
        gpr_(gpr, kTabGpr, R::digest, Task::digest),
        bow_(bow, kTabPca, R::digest, Task::digest),
        time_(time, kTabRbf, R::digest, Task::digest),
        trust_(trust, kTabLogit, R::digest, Task::digest),
        tables_{&knn_.table, &gpr_.table, &bow_.table, &time_.table, &trust_.table},
        work_(std::make_unique<MemoryWork<Task>>()),
        answer_(std::make_unique<MemoryAnswer<Task>>()) {
    char text[TAB_TEXT];
    if (memory_check<Task>(tables_, text) != kTabOk) throw nb::value_error(text);
  }

  nb::dict query(const In<1>& x0, const In<1>& task, int neighbours, bool regression, int lines, double max_warp,
                 bool recall_controls) {
    check_shape<1>("x0", x0, {nx});
    check_shape<1>("task", task, {Task::ntask});
    ReachTarget target;
    if (!reach_target(task.data(), target)) throw nb::value_error("task: not finite, or its quaternion is zero");
    if (neighbours < 0 || neighbours > kMemoryNeighbours || lines < 0 || lines > kMemoryLines)
      throw nb::value_error("neighbours or lines: out of range");
    MemoryOpts opts;
    opts.neighbours = neighbours;
    opts.regression = regression;
    opts.lines = lines;
    opts.max_warp = max_warp;
    opts.recall_controls = recall_controls;
    double t[N + 1];
    for (int k = 0; k <= N; ++k) t[k] = k * Task::dt;
    {
      nb::gil_scoped_release release;
      memory_query<Task>(tables_, opts, target, x0.data(), N, t, *work_, *answer_);
    }
    const std::size_t m = answer_->n;
    NewArray xs({m, N + 1, nx}), us({m, N, nu}), inputs({m, kMemoryTrustInputs}), trust({m});
    nb::list kinds, sources;
    for (std::size_t i = 0; i < m; ++i) {
      const Guess<Task>& guess = answer_->guess[i];
      std::copy_n(guess.x[0], (N + 1) * nx, xs.row(i));
      std::copy_n(guess.u[0], N * nu, us.row(i));
      std::copy_n(work_->slot[i].trust_inputs, kMemoryTrustInputs, inputs.row(i));
      trust.data()[i] = guess.trust;
      kinds.append(guess.kind == GuessKind::kNeighbour    ? "neighbour"
                   : guess.kind == GuessKind::kRegression ? "regression"
                                                          : "line");
      sources.append(guess.source);
    }
    nb::dict result;
    result["xs"] = xs.release();
    result["us"] = us.release();
    result["trust"] = trust.release();
    result["trust_inputs"] = inputs.release();
    result["kind"] = kinds;
    result["source"] = sources;
    result["refused"] = answer_->refused;
    result["status"] = tab_status_text(answer_->status);
    result["distance"] = answer_->distance;
    result["deviation"] = answer_->deviation;
    return result;
  }

 private:
  HeldTable<TabKnn> knn_;
  HeldTable<TabGpr> gpr_;
  HeldTable<TabPca> bow_;
  HeldTable<TabRbf> time_;
  HeldTable<TabLogit> trust_;
  MemoryTables tables_;
  std::unique_ptr<MemoryWork<Task>> work_;
  std::unique_ptr<MemoryAnswer<Task>> answer_;
};

template <class Task> void bind_task_memory(nb::module_& engine, const char* name) {
  using namespace nb::literals;
  using M = Memory<Task>;
  nb::class_<M>(engine, name, "The memory of a task on tables of engram.emit.kinds.")
      .def(nb::init<const nb::object&, const nb::object&, const nb::object&, const nb::object&, const nb::object&>(), "knn"_a,
           "gpr"_a, "bow"_a, "time"_a, "trust"_a)
      .def("query", &M::query, "x0"_a, "task"_a, "neighbours"_a = kMemoryNeighbours, "regression"_a = true,
           "lines"_a = kMemoryLines, "max_warp"_a = MemoryOpts{}.max_warp, "recall_controls"_a = MemoryOpts{}.recall_controls,
           "Guesses xs (m, T + 1, nx), us (m, T, nu) with kind, source, trust and what the trust was made from (m, inputs).");
}

}  // namespace

void bind_memory(nb::module_& engine) { bind_task_memory<tasks::PandaReach>(engine, "PandaReachMemory"); }

}  // namespace engram::binding
