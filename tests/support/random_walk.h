// Talos walks, and its memory of steps is random numbers with a valid digest.
#ifndef TESTS_SUPPORT_RANDOM_WALK_H_
#define TESTS_SUPPORT_RANDOM_WALK_H_

#include "controller/engram.h"

namespace engram::test {

// The model. valid: with the digests of its tables.
const engram_model* random_walk(bool valid = true);

}  // namespace engram::test
#endif  // TESTS_SUPPORT_RANDOM_WALK_H_
