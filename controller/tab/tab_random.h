/* Random numbers by counting: Philox 4x32-10. A draw is a function of (seed, stream, index) and of nothing else, so that samples are
 * the same in whatever order, lane or thread they are drawn, and a stored seed replays them.
 *
 *   seed    which experiment       stream   which sample or purpose       index   which draw of the stream
 *
 * 40 multiplications for four words; no state, no memory. Passes BigCrush according to its authors.
 * Source: Salmon, Moraes, Dror, Shaw, Parallel random numbers: as easy as 1, 2, 3 (SC 2011). */
#ifndef CONTROLLER_TAB_TAB_RANDOM_H_
#define CONTROLLER_TAB_TAB_RANDOM_H_

#include <stdint.h>

/* Four words of the counter (index, stream) under the key seed. */
static inline void tab_random_block(uint64_t seed, uint64_t stream, uint64_t index, uint32_t word[4]) {
  uint32_t c0 = (uint32_t)index, c1 = (uint32_t)(index >> 32), c2 = (uint32_t)stream, c3 = (uint32_t)(stream >> 32);
  uint32_t k0 = (uint32_t)seed, k1 = (uint32_t)(seed >> 32);
  for (int round = 0; round < 10; ++round) {
    const uint64_t a = (uint64_t)0xD2511F53u * c0, b = (uint64_t)0xCD9E8D57u * c2;
    c0 = (uint32_t)(b >> 32) ^ c1 ^ k0;
    c1 = (uint32_t)b;
    c2 = (uint32_t)(a >> 32) ^ c3 ^ k1;
    c3 = (uint32_t)a;
    k0 += 0x9E3779B9u;
    k1 += 0xBB67AE85u;
  }
  word[0] = c0;
  word[1] = c1;
  word[2] = c2;
  word[3] = c3;
}

/* A word as a float in [0, 1), exact multiples of 2^-24. */
static inline float tab_random_unit(uint32_t word) { return (float)(word >> 8) * 0x1p-24f; }

/* Draw `index` of a stream, uniform in [0, 1). Four successive draws share a block: a loop over many draws takes whole blocks. */
static inline float tab_random_uniform(uint64_t seed, uint64_t stream, uint64_t index) {
  uint32_t word[4];
  tab_random_block(seed, stream, index >> 2, word);
  return tab_random_unit(word[index & 3]);
}

#endif /* CONTROLLER_TAB_TAB_RANDOM_H_ */
