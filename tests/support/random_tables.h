// A memory that talks nonsense: arrays of a table become random numbers, its digest that of the new ones.
#ifndef TESTS_SUPPORT_RANDOM_TABLES_H_
#define TESTS_SUPPORT_RANDOM_TABLES_H_

#include <cstdint>
#include <deque>
#include <random>
#include <vector>

#include "controller/tab/tab.h"

namespace engram::test {

// Owns what it has made up.
class RandomTables {
 public:
  // Numbers in [-size, size] for an array of the head.
  const float* fill(TabHead& head, int array, float size) {
    constexpr std::size_t line = 64 / sizeof(float);
    std::vector<float>& numbers = numbers_.emplace_back(head.array[array].count + line);
    std::uniform_real_distribution<float> within(-size, size);
    for (float& number : numbers) number = within(rng_);
    const auto past = reinterpret_cast<std::uintptr_t>(numbers.data()) / sizeof(float) % line;
    const float* const at = numbers.data() + (past == 0 ? 0 : line - past);  // tables lie on cache lines
    head.array[array].data = at;
    return at;
  }
  static void sign(TabHead& head) { head.digest = tab_digest(&head); }

 private:
  std::mt19937 rng_{5};
  std::deque<std::vector<float>> numbers_;
};

}  // namespace engram::test
#endif  // TESTS_SUPPORT_RANDOM_TABLES_H_
