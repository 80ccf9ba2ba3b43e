// link: engram_tab engram_tables_panda_reach
// options: -O1
// The query of the Panda's memory: what every guess must be, in and far outside of what the memory knows.
#include "controller/memory/memory_query.h"

#include "controller/memory/memory_check.h"
#include "tables/panda_reach/tables.h"
#include "tables/panda_reach/task.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <string>

namespace engram {
namespace {

using Task = tasks::PandaReach;
using R = Task::Robot;
using P = Reach<Task>;
constexpr int N = Task::nknots, nq = R::nq, nv = R::nv;
constexpr MemoryTables kTables = PANDA_REACH_MEMORY;

struct Query {
  std::mt19937 random;
  double x0[nq + nv] = {}, t[N + 1];
  ReachTarget goal;
  MemoryOpts opts;
  std::unique_ptr<MemoryWork<Task>> work = std::make_unique<MemoryWork<Task>>();
  std::unique_ptr<MemoryAnswer<Task>> answer = std::make_unique<MemoryAnswer<Task>>();

  explicit Query(unsigned seed) : random(seed) {
    memory_init(kTables, *work);
    opts = kTables.ensemble;
    for (int k = 0; k <= N; ++k) t[k] = k * Task::dt;
    for (int i = 0; i < nq; ++i) x0[i] = uniform(R::q_lo[i] + 0.1, R::q_hi[i] - 0.1);
    double q[nq];
    for (int i = 0; i < nq; ++i) q[i] = R::q_home[i] + uniform(-0.5, 0.5);
    aim(q);
  }
  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); }
  // the pose of the hand at q, which can therefore be reached
  void aim(const double* q) {
    Mat3<double> R_WH;
    Vec3<double> p_WH;
    reach_hand<Task>(q, R_WH, p_WH);
    for (int i = 0; i < 3; ++i) goal.p[i] = p_WH[i];
    for (int i = 0; i < 9; ++i) goal.R[i] = R_WH(i / 3, i % 3);
  }
  MemoryAnswer<Task>& ask(int n = N) {
    memory_query<Task>(kTables, opts, goal, x0, n, t, *work, *answer);
    return *answer;
  }
  // distance of the hand to the goal at the end of a guess [m, rad]
  double miss(const Guess<Task>& guess, int n = N) const {
    Mat3<double> R_WH;
    Vec3<double> p_WH;
    reach_hand<Task>(guess.x[n], R_WH, p_WH);
    const Vec3<double> r_R = log3<double>(matmul_transposed<double>(constant33<double>(goal.R), R_WH));
    return std::hypot((p_WH - constant3<double>(goal.p)).norm(), r_R.norm());
  }
};

TEST(MemoryCheck, TheCommittedTablesBelongToTheRobotAndTheTask) {
  char text[TAB_TEXT];
  EXPECT_EQ(memory_check<Task>(kTables, text), kTabOk) << text;
}

TEST(MemoryCheck, AMissingForeignOrMisfittingTableIsNamed) {
  char text[TAB_TEXT];
  MemoryTables tables = kTables;
  tables.gpr = nullptr;
  EXPECT_EQ(memory_check<Task>(tables, text), kTabBad);
  EXPECT_NE(std::string(text).find("no GPR table"), std::string::npos) << text;

  TabKnn foreign = panda_reach_knn_v1;
  foreign.head.robot_digest ^= 1;
  tables = kTables;
  tables.knn = &foreign;
  EXPECT_EQ(memory_check<Task>(tables, text), kTabBad);
  EXPECT_NE(std::string(text).find("another robot"), std::string::npos) << text;

  TabRbf other = panda_reach_time_v1;  // whole in itself, but without channels for the controls
  other.nchannel = other.head.nout = nq;
  tables = kTables;
  tables.time = &other;
  EXPECT_EQ(memory_check<Task>(tables, text), kTabBad);
  EXPECT_NE(std::string(text).find("do not fit each other"), std::string::npos) << text;
}

TEST(MemoryQuery, EveryGuessIsAMotionFromTheStateToTheGoal) {
  int of_kind[6] = {};
  for (unsigned seed = 0; seed < 30; ++seed) {
    Query query(seed);
    for (int i = 0; i < nv; ++i) query.x0[nq + i] = query.uniform(-0.5, 0.5);
    const MemoryAnswer<Task>& answer = query.ask();
    ASSERT_LE(answer.n, kMemoryGuesses);
    for (int g = 0; g < answer.n; ++g) {
      const Guess<Task>& guess = answer.guess[g];
      ++of_kind[int(guess.kind)];
      EXPECT_EQ(std::memcmp(guess.x[0], query.x0, sizeof query.x0), 0);
      EXPECT_GE(guess.trust, 0);
      EXPECT_LE(guess.trust, 1);
      if (guess.kind != GuessKind::kLine && guess.kind != GuessKind::kRegression) {
        EXPECT_LE(guess.warp, query.opts.max_warp);
      }
      // trust 0 marks the only guesses that may miss
      if (guess.trust > 0) {
        EXPECT_LT(query.miss(guess), 1.1 * kMemoryIkTolerance);
      }
      for (int k = 0; k < N; ++k) {
        P::Knot<double> knot;
        double x_next[P::nx], cost;
        reach_knot<Task>(query.goal, Task::dt, query.t[k], knot);
        P::calc(knot, guess.x[k], guess.u[k], x_next, cost);
        // forward dynamics undo inverse dynamics: condition of the mass matrix (1e3) times rounding times torques of 1e3 N m
        for (int i = 0; i < P::nx; ++i) ASSERT_NEAR(x_next[i], guess.x[k + 1][i], 1e-9) << "seed " << seed << " guess " << g;
      }
    }
  }
  EXPECT_GT(of_kind[int(GuessKind::kNeighbour)], 60);  // two per query, far from the data as these random states are
  EXPECT_GT(of_kind[int(GuessKind::kMixture)] + of_kind[int(GuessKind::kNetwork)], 30);
  EXPECT_GT(of_kind[int(GuessKind::kTrain)], 10);
  EXPECT_GT(of_kind[int(GuessKind::kRegression)], 60);
  EXPECT_EQ(of_kind[int(GuessKind::kLine)], 30 * kMemoryLines);
}

TEST(MemoryQuery, OrderAndOptions) {
  Query query(3);
  const auto count = [&query](GuessKind kind) {
    int n = 0;
    for (int g = 0; g < query.answer->n; ++g) n += query.answer->guess[g].kind == kind;
    return n;
  };
  const MemoryAnswer<Task>& all = query.ask();
  EXPECT_TRUE(std::isfinite(all.distance));
  EXPECT_GT(all.deviation, 0);
  EXPECT_LT(all.deviation, 1);
  for (int g = 1; g < all.n; ++g) {
    constexpr int kRank[] = {0, 4, 3, 1, 2, 1};  // neighbours, modes, trains, lines, regressions
    const auto rank = [&](GuessKind kind) { return kRank[int(kind)]; };
    EXPECT_LE(rank(all.guess[g - 1].kind), rank(all.guess[g].kind));
  }
  query.opts.regression = false;
  query.ask();
  EXPECT_EQ(count(GuessKind::kRegression), 0);
  query.opts.neighbours = query.opts.modes = query.opts.trains = 0;
  const MemoryAnswer<Task>& lines = query.ask();
  EXPECT_EQ(lines.n, kMemoryLines - 1);  // no best neighbour to go to
  EXPECT_EQ(count(GuessKind::kLine), lines.n);
  EXPECT_TRUE(std::isinf(lines.distance));
  EXPECT_EQ(lines.deviation, 1);
  query.opts.lines = 0;
  EXPECT_EQ(query.ask().n, 0);
  query.opts = kTables.ensemble;
  query.opts.neighbours = 1;
  query.ask();
  EXPECT_LE(count(GuessKind::kNeighbour), 1);
}

TEST(MemoryQuery, WithoutLearnersAndTrainTheOtherGuessesAreTheSame) {
  Query query(4);
  query.ask();
  MemoryTables tables = kTables;
  for (const TabHead*& learner : tables.learner) learner = nullptr;
  tables.train = nullptr;
  const auto work = std::make_unique<MemoryWork<Task>>();
  const auto answer = std::make_unique<MemoryAnswer<Task>>();
  memory_query<Task>(tables, query.opts, query.goal, query.x0, N, query.t, *work, *answer);
  int same = 0, modes = 0;
  for (int g = 0; g < query.answer->n; ++g) {
    const Guess<Task>& guess = query.answer->guess[g];
    if (guess.kind == GuessKind::kMixture || guess.kind == GuessKind::kNetwork || guess.kind == GuessKind::kTrain) {
      ++modes;
      EXPECT_GE(guess.source, 0);
      continue;
    }
    ASSERT_LT(same, answer->n);
    EXPECT_EQ(std::memcmp(guess.x, answer->guess[same++].x, sizeof guess.x), 0);
  }
  EXPECT_EQ(same, answer->n);
  EXPECT_GT(modes, 0);
}

TEST(MemoryPose, SixNumbersGiveTheSamePose) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    Query query(seed);
    double x[kMemoryPose];
    memory_pose(query.goal, x);
    const Mat3<double> R_WT = memory_pose_rotation(x + 3);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(x[i], query.goal.p[i]);
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(R_WT(i / 3, i % 3), query.goal.R[i], 1e-14);  // rounding of a few sines
  }
  // forward, down, and a roll by pi lie well inside of the angles' ranges
  const double forward[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0}, down[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  ReachTarget goal{};
  double x[kMemoryPose];
  std::memcpy(goal.R, forward, sizeof forward);
  memory_pose(goal, x);
  EXPECT_NEAR(x[3], M_PI / 2, 1e-15);
  EXPECT_NEAR(x[5], 0, 1e-15);
  std::memcpy(goal.R, down, sizeof down);
  memory_pose(goal, x);
  EXPECT_NEAR(x[3], M_PI, 1e-15);
  EXPECT_NEAR(std::fabs(x[5] - M_PI), 0, 1e-15);
}

TEST(MemoryTrain, PosturesDifferAndTheCheapestComesFirst) {
  int found = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Query query(seed);
    MemoryTrain<Task>& train = query.work->train;
    double posture[kMemoryTrains][nq], again[kMemoryTrains][nq];
    TabStatus status;
    const int n = memory::likely_postures<Task>(query.goal, 1, kMemoryTrains, train, status, posture);
    ASSERT_LE(n, kMemoryTrains);
    double last = 0;
    for (int i = 0; i < n; ++i) {
      const double cost = memory::posture_cost<Task>(query.goal, posture[i]);
      EXPECT_GE(cost, last);
      last = cost;
      for (int j = 0; j < i; ++j) {
        double apart = 0;
        for (int k = 0; k < nq; ++k) apart = std::fmax(apart, std::fabs(posture[i][k] - posture[j][k]));
        EXPECT_GT(apart, kMemoryTrainApart);
      }
    }
    ASSERT_EQ(memory::likely_postures<Task>(query.goal, 1, kMemoryTrains, train, status, again), n);
    EXPECT_EQ(std::memcmp(posture, again, sizeof *posture * n), 0);
    found += n;
  }
  EXPECT_GT(found, 40);
}

TEST(MemoryQuery, ARememberedTaskIsRecalled) {
  // start, end and bow of a sample: the query must propose a path from its start to its end
  int recalled = 0;
  constexpr int kSamples = 20;
  for (int sample = 0; sample < kSamples; ++sample) {
    Query query(0);
    const TabKnn& knn = panda_reach_knn_v1;
    const float* block = knn.x + (sample / TAB_LANES) * knn.d * TAB_LANES + sample % TAB_LANES;
    for (int i = 0; i < nq; ++i) query.x0[i] = block[i * TAB_LANES] / knn.scale[i];
    double end[nq];
    for (int i = 0; i < nq; ++i) end[i] = tab_knn_value(&knn, sample)[i];
    query.aim(end);
    const MemoryAnswer<Task>& answer = query.ask();
    EXPECT_LT(answer.distance, 0.5) << "the hand at the end of a sample is within centimetres of its target";
    for (int g = 0; g < answer.n; ++g) recalled += answer.guess[g].kind == GuessKind::kNeighbour && answer.guess[g].source == sample;
  }
  EXPECT_EQ(recalled, kSamples);
}

TEST(MemoryQuery, RecalledControlsAreAddedToThoseOfTheSameMotion) {
  int recalled = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    Query query(seed), other(seed);
    other.opts.recall_controls = true;
    const MemoryAnswer<Task>&motions = query.ask(), &answer = other.ask();
    ASSERT_EQ(answer.n, motions.n);
    for (int g = 0; g < answer.n; ++g) {
      const Guess<Task>&a = motions.guess[g], &b = answer.guess[g];
      EXPECT_EQ(std::memcmp(a.x, b.x, sizeof a.x), 0);
      double most = 0;
      for (int k = 0; k < N; ++k)
        for (int i = 0; i < R::nu; ++i) most = std::fmax(most, std::fabs(b.u[k][i] - a.u[k][i]));
      if (b.kind == GuessKind::kLine) {
        EXPECT_EQ(most, 0) << "a line remembers nothing";
        continue;
      }
      EXPECT_GT(most, 0.01);  // N m
      EXPECT_LT(most, 30);    // N m: a correction, not another motion
      ++recalled;
    }
  }
  EXPECT_GT(recalled, 30);
}

TEST(MemoryQuery, TheLastLineMayEndElsewhere) {
  const auto end = [](const MemoryAnswer<Task>& answer, int source) {
    for (int g = 0; g < answer.n; ++g)
      if (answer.guess[g].kind == GuessKind::kLine && answer.guess[g].source == source) return answer.guess[g].x[N];
    return static_cast<const double*>(nullptr);
  };
  Query here(3), elsewhere(3), again(3);
  here.ask();
  int other = 0;
  for (int64_t draw = 1; draw <= 20; ++draw) {
    elsewhere.opts.elsewhere = again.opts.elsewhere = draw;
    elsewhere.ask();
    again.ask();
    for (int source = 0; source < kMemoryLines; ++source) {
      const double *a = end(*here.answer, source), *b = end(*elsewhere.answer, source), *c = end(*again.answer, source);
      ASSERT_EQ(a == nullptr, b == nullptr);
      if (a == nullptr) continue;
      EXPECT_EQ(std::memcmp(b, c, sizeof *b * nq), 0) << "a draw is a function of its number";
      double most = 0;
      for (int i = 0; i < nq; ++i) most = std::fmax(most, std::fabs(a[i] - b[i]));
      if (source == 2) other += most > 0.3;
      else EXPECT_EQ(most, 0);
    }
  }
  EXPECT_GT(other, 10);  // a random posture leads to another end more often than not
}

TEST(MemoryQuery, NothingUsableGivesNoGuess) {
  for (double bad : {std::nan(""), static_cast<double>(INFINITY), -static_cast<double>(INFINITY), 1e300, -1e7}) {
    for (int what = 0; what < 4; ++what) {
      Query query(5);
      (what == 0 ? query.x0[2] : what == 1 ? query.x0[nq + 3] : what == 2 ? query.goal.p[1] : query.goal.R[4]) = bad;
      const MemoryAnswer<Task>& answer = query.ask();
      EXPECT_EQ(answer.n, 0);
      EXPECT_EQ(answer.status, kTabNotFinite);
    }
  }
}

TEST(MemoryQuery, AGoalOutOfReachIsNotTrusted) {
  Query query(6);
  query.goal.p[0] = 3.0;  // the arm is 0.9 m long
  const MemoryAnswer<Task>& answer = query.ask();
  EXPECT_EQ(answer.status, kTabOutside);
  EXPECT_EQ(answer.n, kMemoryLines - 1);  // towards it, as straight lines, at no trust
  for (int g = 0; g < answer.n; ++g) {
    EXPECT_EQ(answer.guess[g].kind, GuessKind::kLine);
    EXPECT_EQ(answer.guess[g].trust, 0);
    for (const auto& x : answer.guess[g].x)
      for (double e : x) ASSERT_TRUE(std::isfinite(e));
  }
}

TEST(MemoryQuery, TwoThousandQueriesStayFiniteAndBounded) {
  Query query(7);
  int outside = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const bool wild = trial % 4 == 3;  // states and goals that no arm can have
    for (int i = 0; i < nq; ++i) query.x0[i] = wild ? query.uniform(-100, 100) : query.uniform(R::q_lo[i], R::q_hi[i]);
    for (int i = 0; i < nv; ++i) query.x0[nq + i] = wild ? query.uniform(-50, 50) : query.uniform(-1, 1);
    for (double& p : query.goal.p) p = wild ? query.uniform(-5, 5) : query.uniform(-0.8, 0.8);
    const int n = trial % 3 == 0 ? 2 : 1;  // few knots: the ends and the tables are what is tried here
    query.t[1] = trial % 5 == 0 ? 1e-4 : Task::dt;
    query.t[2] = query.t[1] + Task::dt;
    const MemoryAnswer<Task>& answer = query.ask(n);
    outside += answer.status == kTabOutside;
    ASSERT_LE(answer.n, kMemoryGuesses);
    ASSERT_NE(answer.status, kTabNotFinite);
    for (int g = 0; g < answer.n; ++g) {
      const Guess<Task>& guess = answer.guess[g];
      ASSERT_TRUE(guess.trust >= 0 && guess.trust <= 1 && std::isfinite(guess.warp));
      for (int k = 0; k <= n; ++k)
        for (double e : guess.x[k]) ASSERT_TRUE(std::isfinite(e));
      for (int k = 0; k < n; ++k)
        for (double e : guess.u[k]) ASSERT_TRUE(std::isfinite(e));
    }
  }
  EXPECT_GE(outside, 500);  // all the wild ones
}

TEST(MemoryQuery, TheSameQuestionGetsTheSameAnswer) {
  Query a(8), b(8);
  std::memset(static_cast<void*>(b.work.get()), 0x5a, sizeof *b.work);  // whatever the scratch held before
  memory_init(kTables, *b.work);
  a.ask();
  b.ask();
  ASSERT_EQ(a.answer->n, b.answer->n);
  for (int g = 0; g < a.answer->n; ++g) {
    EXPECT_EQ(std::memcmp(a.answer->guess[g].x, b.answer->guess[g].x, sizeof a.answer->guess[g].x), 0);
    EXPECT_EQ(std::memcmp(a.answer->guess[g].u, b.answer->guess[g].u, sizeof a.answer->guess[g].u), 0);
    EXPECT_EQ(a.answer->guess[g].trust, b.answer->guess[g].trust);
  }
}

TEST(MemoryQuery, BeyondTheMemorysLengthAGuessRests) {
  Query query(9);
  for (int k = 0; k <= N; ++k) query.t[k] = 2 * k * Task::dt;
  const MemoryAnswer<Task>& answer = query.ask();
  for (int g = 0; g < answer.n; ++g) {
    for (int k = N / 2 + 2; k <= N; ++k) {
      for (int i = 0; i < nv; ++i) EXPECT_NEAR(answer.guess[g].x[k][nq + i], 0, 1e-9);
    }
  }
}

}  // namespace
}  // namespace engram
