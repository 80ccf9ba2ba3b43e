// The memory in Python: the deployed query, on tables that are still arrays (engram.emit.kinds), so that a fit can be judged and its
// trust calibrated before anything is written.
#include "codegen/binding/arrays.h"
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/held_table.h"
#include "controller/loop/loop_goals.h"
#include "controller/loop/loop_reach_memory.h"
#include "tables/panda_reach/task.h"

#include <algorithm>
#include <deque>
#include <optional>

namespace engram::binding {
namespace {

template <class Task> class Memory {
  using R = typename Task::Robot;
  static constexpr int N = Task::nknots, nx = R::nq + R::nv, nu = R::nu;

 public:
  Memory(const nb::object& knn, const nb::object& gpr, const nb::object& bow, const nb::object& time, const nb::object& trust,
         const nb::list& learners, const nb::object& train, int neighbours, int trains, bool regression, int lines)
      : knn_(knn, R::digest, Task::digest),
        gpr_(gpr, R::digest, Task::digest),
        bow_(bow, R::digest, Task::digest),
        time_(time, R::digest, Task::digest),
        trust_(trust, R::digest, Task::digest),
        tables_{knn_.as<TabKnn>(), gpr_.as<TabGpr>(), bow_.as<TabPca>(), time_.as<TabRbf>(), trust_.as<TabLogit>()},
        work_(std::make_unique<MemoryWork<Task>>()),
        answer_(std::make_unique<MemoryAnswer<Task>>()) {
    if (learners.size() > kMemoryLearners) throw nb::value_error("learners: too many");
    for (nb::handle learner : learners) {
      const HeldTable& held = learners_.emplace_back(nb::borrow<nb::object>(learner), R::digest, Task::digest);
      tables_.learner[learners_.size() - 1] = held.head();
    }
    if (!train.is_none()) tables_.train = train_.emplace(train, R::digest, Task::digest).template as<TabTt>();
    if (neighbours < 0 || neighbours > kMemoryNeighbours || trains < 0 || trains > kMemoryTrains || lines < 0 || lines > kMemoryLines)
      throw nb::value_error("neighbours, trains or lines: out of range");
    MemoryOpts& ensemble = tables_.ensemble;
    ensemble.neighbours = neighbours;
    ensemble.trains = trains;
    ensemble.regression = regression;
    ensemble.lines = lines;
    char text[TAB_TEXT];
    if (memory_check<Task>(tables_, text) != kTabOk) throw nb::value_error(text);
    memory_init(tables_, *work_);
  }

  nb::dict query(const In<1>& x0, const In<1>& task) {
    check_shape<1>("x0", x0, {nx});
    check_shape<1>("task", task, {Task::ntask});
    ReachTarget target;
    if (!reach_target(task.data(), target)) throw nb::value_error("task: not finite, or its quaternion is zero");
    double t[N + 1];
    for (int k = 0; k <= N; ++k) t[k] = k * Task::dt;
    {
      nb::gil_scoped_release release;
      memory_query<Task>(tables_, tables_.ensemble, target, x0.data(), N, t, *work_, *answer_);
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
                   : guess.kind == GuessKind::kMixture    ? "mixture"
                   : guess.kind == GuessKind::kTrain      ? "train"
                   : guess.kind == GuessKind::kNetwork    ? "network"
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

  // The memory as a metric: index of the goal with the cheapest guess among the tasks (n, ntask), and the merit of each (n)
  nb::tuple metric(const In<1>& x0, const In<2>& tasks) {
    check_shape<1>("x0", x0, {nx});
    check_shape<2>("tasks", tasks, {-1, Task::ntask});
    const std::size_t n = tasks.shape(0);
    std::vector<ReachTarget> goals(n);
    for (std::size_t i = 0; i < n; ++i)
      if (!reach_target(tasks.data() + i * Task::ntask, goals[i])) throw nb::value_error("tasks: not finite, or a zero quaternion");
    const auto horizon = std::make_unique<Horizon<typename Model::P, N>>();
    Candidate<typename Model::P> candidates[kMemoryGuesses];
    const auto ask = [&](const ReachTarget& goal, const double* t, Candidate<typename Model::P>* found) {
      memory_query<Task>(tables_, tables_.ensemble, goal, x0.data(), N, t, *work_, *answer_);
      return reach_candidates(*answer_, found, 0);
    };
    NewArray merit({n});
    const int best = loop_choose_goal<Model>(goals.data(), int(n), x0.data(), ask, merit.data(), *horizon, candidates);
    return nb::make_tuple(best, merit.release());
  }

 private:
  using Model = ReachModel<Task, void>;
  HeldTable knn_, gpr_, bow_, time_, trust_;
  std::deque<HeldTable> learners_;
  std::optional<HeldTable> train_;
  MemoryTables tables_;
  std::unique_ptr<MemoryWork<Task>> work_;
  std::unique_ptr<MemoryAnswer<Task>> answer_;
};

template <class Task> void bind_task_memory(nb::module_& engine, const char* name) {
  using namespace nb::literals;
  using M = Memory<Task>;
  nb::class_<M>(engine, name, "The memory of a task on tables of engram.emit.kinds.")
      .def(nb::init<const nb::object&, const nb::object&, const nb::object&, const nb::object&, const nb::object&, const nb::list&,
                    const nb::object&, int, int, bool, int>(),
           "knn"_a, "gpr"_a, "bow"_a, "time"_a, "trust"_a, "learners"_a, "train"_a.none(), nb::kw_only(), "neighbours"_a, "trains"_a,
           "regression"_a, "lines"_a)
      .def("query", &M::query, "x0"_a, "task"_a,
           "Guesses xs (m, T + 1, nx), us (m, T, nu) with kind, source, trust and what the trust was made from (m, inputs).")
      .def("metric", &M::metric, "x0"_a, "tasks"_a,
           "Of several goals (n, ntask), the index of the one with the cheapest guess, and the merit of each one's best guess (n).");
}

}  // namespace

void bind_memory(nb::module_& engine) { bind_task_memory<tasks::PandaReach>(engine, "PandaReachMemory"); }

}  // namespace engram::binding
