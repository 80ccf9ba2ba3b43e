// The memory's queries on the Panda's tables: numbers for the equality gate, and times.
//
//   query_bench compare QUERIES    k-NN and regression at given inputs
//   query_bench time QUERIES N     N passes over the inputs: each table, and the whole query of the memory [us per query], and the
//                                  calls of the allocators in all of them; "planted": those of a new and a delete, which are 2
//
// QUERIES: per query the features of the k-NN (16), then those of the regression (17). Writes one JSON object.
#include "bench/stopwatch.h"
#include "controller/memory/memory_query.h"
#include "tables/panda_reach/tables.h"
#include "tables/panda_reach/task.h"
#include "tests/support/count_heap.h"

#include <memory>
#include <string>

namespace {

using namespace engram;
using Task = tasks::PandaReach;
constexpr int N = Task::nknots, nq = Task::Robot::nq, nx = nq + Task::Robot::nv;
constexpr int kNearest = 10;
constexpr MemoryTables kTables = PANDA_REACH_MEMORY;

struct Query {
  const double *near, *between;  // features of the k-NN, of the regression
};

struct Scratch {
  int32_t index[kNearest];
  float distance2[kNearest], variance, mean[kMemoryMaxBow], weights[TAB_RBF_MAX_K * nq + TAB_LANES];
  double t[N + 1], basis[(N + 1) * TAB_RBF_MAX_K], bow[(N + 1) * nq];
  MemoryWork<Task> work;
  MemoryAnswer<Task> answer;
};

void compare(const std::vector<Query>& queries, Scratch& s) {
  std::vector<double> nearest, distance, mean, variance;
  for (const Query& q : queries) {
    tab_knn_query(kTables.knn, q.near, kNearest, s.index, s.distance2);
    tab_gpr_query(kTables.gpr, q.between, s.mean, &s.variance);
    nearest.insert(nearest.end(), s.index, s.index + kNearest);
    distance.insert(distance.end(), s.distance2, s.distance2 + kNearest);
    mean.insert(mean.end(), s.mean, s.mean + kTables.gpr->m);
    variance.push_back(s.variance);
  }
  bench::Report report;
  report.list("index", nearest);
  report.list("distance2", distance);
  report.list("mean", mean);
  report.list("variance", variance);
}

// Calls of the allocators in f
template <class F> double allocations(F&& f) {
  const long long before = calls;
  counting = true;
  f();
  counting = false;
  return double(calls - before);
}

// The task whose features these are: third axis and first axis give the rotation.
ReachTarget target_of(const double* near) {
  const Vec3<double> z = constant3<double>(near + nq + 3).normalized();
  const Vec3<double> x = (constant3<double>(near + nq + 6) - z * z.dot(constant3<double>(near + nq + 6))).normalized();
  const Vec3<double> y = cross(z, x);
  ReachTarget target;
  for (int i = 0; i < 3; ++i) {
    target.p[i] = near[nq + i];
    target.R[3 * i] = x[i];
    target.R[3 * i + 1] = y[i];
    target.R[3 * i + 2] = z[i];
  }
  return target;
}

void time(const std::vector<Query>& queries, int passes, Scratch& s) {
  bench::Report report;
  const auto measure = [&](const char* name, auto query) {
    double allocated = 0;
    const auto pass = [&] {
      allocated += allocations([&] {
        for (const Query& q : queries) {
          query(q);
          bench::keep(s);
        }
      });
    };
    report.list(name, bench::sample_us(passes, pass, double(queries.size())));
    report.number(("allocations." + std::string(name)).c_str(), allocated);
  };
  report.number("allocations.planted", allocations([] {
    int* volatile number = new int(1);
    delete number;
  }));
  for (int k = 0; k <= N; ++k) s.t[k] = k * Task::dt;
  measure("knn", [&](const Query& q) { tab_knn_query(kTables.knn, q.near, kNearest, s.index, s.distance2); });
  measure("gpr", [&](const Query& q) { tab_gpr_query(kTables.gpr, q.between, s.mean, &s.variance); });
  measure("pca", [&](const Query&) { tab_pca_decode(kTables.bow, s.mean, s.weights); });
  measure("rbf", [&](const Query&) {
    tab_rbf_basis(kTables.time, N + 1, s.t, s.basis, nullptr);
    tab_rbf_eval(kTables.time, s.weights, 0, nq, N + 1, s.basis, s.bow);
  });
  measure("memory", [&](const Query& q) {
    double x0[nx] = {};
    for (int i = 0; i < nq; ++i) x0[i] = q.near[i];
    memory_query<Task>(kTables, MemoryOpts{}, target_of(q.near), x0, N, s.t, s.work, s.answer);
  });
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || (std::string(argv[1]) == "time" && argc < 4)) {
    std::fprintf(stderr, "usage: query_bench compare QUERIES | query_bench time QUERIES N\n");
    return 2;
  }
  const std::vector<double> numbers = bench::read_numbers(argv[2]);
  std::vector<Query> queries;
  constexpr std::size_t size = kMemoryFeatures<Task> + kMemoryBowFeatures<Task>;
  for (std::size_t i = 0; i + size <= numbers.size(); i += size) {
    queries.push_back({&numbers[i], &numbers[i + kMemoryFeatures<Task>]});
  }
  const auto scratch = std::make_unique<Scratch>();
  if (std::string(argv[1]) == "compare") compare(queries, *scratch);
  else time(queries, std::atoi(argv[3]), *scratch);
  return 0;
}
