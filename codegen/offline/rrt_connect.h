// A way between configurations on a constraint manifold: RRT-Connect with projection, on a pool of nodes of fixed size.
//
//   two trees, from the start and from the goals. In turn: one grows a step toward a random sample; the other goes on toward the new node,
//   step by step, until it meets it or is blocked. Every step is projected onto the manifold by the space.
//
// Sources: Kuffner and LaValle, RRT-Connect, ICRA 2000; Berenson et al., Manipulation planning on constraint manifolds, ICRA 2009.
// A space has
//
//   struct Node;                                       a configuration
//   void sample(std::mt19937_64&, Node&) const         anywhere, not projected
//   double distance(const Node&, const Node&) const
//   bool step(const Node& from, const Node& to, Node& next, bool& there) const
//                                                      one projected step of bounded length; false: blocked. there: next is at `to`
#ifndef CODEGEN_OFFLINE_RRT_CONNECT_H_
#define CODEGEN_OFFLINE_RRT_CONNECT_H_

#include <cstdint>
#include <random>

namespace engram {

enum class RrtResult { kFound, kNoStart, kNoGoal, kPoolSpent };

// kPool: most nodes of both trees together, and of a path.
template <class Space, int kPool> class RrtConnect {
 public:
  using Node = typename Space::Node;

  // A path from start to one of the goals: path()[0 .. size()). The same seed gives the same path. kPoolSpent: no way was found.
  RrtResult plan(const Space& space, const Node& start, const Node* goals, int ngoals, uint64_t seed) {
    size_ = 0;
    if (ngoals < 1) return RrtResult::kNoGoal;
    rng_.seed(seed);
    count_ = 0;
    tree_[0].n = tree_[1].n = 0;
    add(0, start, -1);
    for (int i = 0; i < ngoals && count_ < kPool; ++i) add(1, goals[i], -1);
    int grows = 0;
    for (int tries = 0; tries < kTriesPerNode * kPool && count_ < kPool; ++tries, grows = 1 - grows) {
      Node far, next;
      bool there;
      space.sample(rng_, far);
      const int near = nearest(space, grows, far);
      if (!space.step(pool_[near], far, next, there)) continue;
      const int fresh = add(grows, next, near);
      const int met = connect(space, 1 - grows, next);
      if (met >= 0) return join(grows == 0 ? fresh : met, grows == 0 ? met : fresh);
    }
    return RrtResult::kPoolSpent;
  }

  // Random parts of the path are replaced by straight ones, where those are free.
  void shorten(const Space& space, int cuts) {
    for (int cut = 0; cut < cuts && size_ > 2; ++cut) {
      const int a = static_cast<int>(rng_() % static_cast<uint64_t>(size_ - 2));
      const int b = a + 2 + static_cast<int>(rng_() % static_cast<uint64_t>(size_ - 2 - a));
      Node at = path_[a];
      int n = 0;
      bool there = false;
      while (a + n + 1 < b && !there && space.step(at, path_[b], at, there)) straight_[n++] = at;
      if (!there) continue;
      for (int i = 0; i < n; ++i) path_[a + 1 + i] = straight_[i];  // the last of them stands where b was
      for (int i = b + 1; i < size_; ++i) path_[a + n + i - b] = path_[i];
      size_ -= b - a - n;
    }
  }

  const Node* path() const { return path_; }
  int size() const { return size_; }
  int nodes() const { return count_; }

 private:
  static constexpr int kTriesPerNode = 10;
  struct Tree {
    int n = 0, index[kPool];
  };

  int add(int tree, const Node& node, int parent) {
    pool_[count_] = node;
    parent_[count_] = parent;
    tree_[tree].index[tree_[tree].n++] = count_;
    return count_++;
  }
  int nearest(const Space& space, int tree, const Node& to) const {
    int best = tree_[tree].index[0];
    double least = space.distance(pool_[best], to);
    for (int i = 1; i < tree_[tree].n; ++i) {
      const double d = space.distance(pool_[tree_[tree].index[i]], to);
      if (d < least) least = d, best = tree_[tree].index[i];
    }
    return best;
  }
  // Goes on toward `to` as far as it can. The node that is there; -1 if none is.
  int connect(const Space& space, int tree, const Node& to) {
    int at = nearest(space, tree, to);
    Node next;
    bool there = false;
    while (!there && count_ < kPool && space.step(pool_[at], to, next, there)) at = add(tree, next, at);
    return there ? at : -1;
  }
  // From the root of one tree to `ahead`, and from `behind` to the root of the other.
  RrtResult join(int ahead, int behind) {
    for (int i = ahead; i >= 0; i = parent_[i]) ++size_;
    for (int i = ahead, k = size_; i >= 0; i = parent_[i]) path_[--k] = pool_[i];
    for (int i = parent_[behind]; i >= 0; i = parent_[i]) path_[size_++] = pool_[i];  // `behind` is where `ahead` is
    return RrtResult::kFound;
  }

  std::mt19937_64 rng_;
  int count_ = 0, size_ = 0;
  Tree tree_[2];
  Node pool_[kPool], path_[kPool], straight_[kPool];
  int parent_[kPool];
};

}  // namespace engram
#endif  // CODEGEN_OFFLINE_RRT_CONNECT_H_
