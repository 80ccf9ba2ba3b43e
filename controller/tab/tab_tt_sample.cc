// Conditioning and sampling of a tensor train.
#include "controller/tab/tab_random.h"
#include "controller/tab/tab_tt_core.h"

using namespace engram;

namespace {

// x^power for x in [2^-126, 1] whose power is at least 2^-126, or x = 0. By log2 and exp2 of the eight lanes: relative error below
// (3 + power) 1e-6.
TabLanes power_of(const TabLanes& x, float power) {
  typedef int32_t Words __attribute__((vector_size(sizeof(TabLanes))));
  Words bits;
  std::memcpy(&bits, &x, sizeof bits);
  // x = 2^e m, m in [sqrt(1/2), sqrt(2));  log2 m = 2 / ln 2 (s + s^3 / 3 + ...),  s = (m - 1) / (m + 1)
  const Words e = (bits - 0x3f3504f3) >> 23;
  const Words mantissa = bits - (e << 23);
  TabLanes m;
  std::memcpy(&m, &mantissa, sizeof m);
  const TabLanes s = (m - 1.0f) / (m + 1.0f), s2 = s * s;
  const TabLanes log2_m = s * (2.88539008f + s2 * (0.961796694f + s2 * (0.577078016f + s2 * (0.412198583f + s2 * 0.320598898f))));
  const TabLanes y = (__builtin_convertvector(e, TabLanes) + log2_m) * power;
  // 2^y = 2^i 2^f, f in [-1/2, 1/2]
  const TabLanes low = tab_fill(-126.0f);
  const TabLanes clipped = y > low ? y : low;
  const Words i = __builtin_convertvector(clipped - 0.5f, Words);  // towards zero: the nearest integer, y being negative
  const TabLanes f = clipped - __builtin_convertvector(i, TabLanes);
  const TabLanes two_f = 1.0f + f * (0.693147181f + f * (0.240226507f + f * (0.0555041087f + f * (0.00961812911f + f * (0.00133335581f +
                         f * 0.000154035304f)))));
  const Words scale_bits = (i + 127) << 23;
  TabLanes scale;
  std::memcpy(&scale, &scale_bits, sizeof scale);
  const TabLanes zero{};
  return x > zero ? two_f * scale : zero;
}

// x^power for a whole number > 0, by repeated squaring: relative error below power 2^-24. No step is smaller than the result.
TabLanes power_of(const TabLanes& base, int32_t power) {
  TabLanes x = base;
  for (; !(power & 1); power >>= 1) x *= x;
  TabLanes y = x;
  while (power >>= 1) {
    x *= x;
    if (power & 1) y *= x;
  }
  return y;
}

// The exponent of a call, 1 / (1 - alpha).
struct Power {
  float beta;
  int32_t whole;  // beta, where it is a small whole number: for alpha = 0, 1/2, 3/4, 0.8, 0.9 it is; else 0
  float least;    // x below it gives 0: its power is below 2^-126, and numbers so small take some processors a hundred cycles each
  bool greedy;    // the largest alone

  explicit Power(double alpha) {
    greedy = alpha >= 1 - 1e-6;
    beta = greedy ? 1.0f : static_cast<float>(1 / (1 - std::fmax(alpha, 0.0)));
    whole = beta <= 64 && beta == std::floor(beta) ? static_cast<int32_t>(beta) : 0;
    least = std::pow(2.0f, -126.0f / beta);
  }
};

// pi_k (rows) and W_k (rows, pad(n)) of one core from pi_k+1
void marginal_of(const TtCore& core, const float* pi_next, float* W, float* pi) {
  const int32_t stride = tab_pad(core.n);
  for (int32_t i = 0; i < core.n; ++i) tt_slice_times_column(core, i, pi_next, W + i, stride);
  std::memset(pi, 0, sizeof(float) * TAB_TT_MAX_R);
  for (int32_t j = 0; j < core.rows; ++j) {
    for (int32_t i = core.n; i < stride; ++i) W[j * stride + i] = 0;
    for (int32_t i = 0; i < core.n; ++i) pi[j] += W[j * stride + i];
  }
  tt_rescale(pi, core.rows);
}

// row = row P^k(x_k), the core interpolated
void row_at(const TtCore& core, const TtPoint& at, const float* row, float* out) {
  alignas(64) float next[TAB_TT_MAX_R];
  tt_row_times_slice(core, at.i, row, out);
  if (at.t == 0.0f) return;
  tt_row_times_slice(core, at.i + 1, row, next);
  for (int32_t j = 0; j < core.columns; ++j) out[j] = (1 - at.t) * out[j] + at.t * next[j];
}

// One multinomial over the grid points of a variable.
struct Choice {
  alignas(64) float p[TAB_TT_MAX_N];
  int32_t n, n_pad, largest;  // largest: index of the largest p
  float up_to[TAB_LANES];     // sums of p over the points i = 0 .. lane (mod 8)
  float total;                // the last of them
  bool greedy;

  // From p = row W: |p|, scaled to a largest entry of 1, to the power beta; uniform if all are below 2^-126. Greedy: the largest alone.
  void prepare(const Power& power) {
    TabLanes top{};
    for (int32_t i = 0; i < n_pad; i += TAB_LANES) {
      const TabLanes v = tab_load(p + i), a = v < 0.0f ? -v : v;
      tab_store(p + i, a);
      top = a > top ? a : top;
    }
    float most = tab_max(top);
    if (!(most >= 0x1p-126f) || !std::isfinite(most)) {
      for (int32_t i = 0; i < n_pad; ++i) p[i] = i < n ? 1.0f : 0.0f;
      most = 1;
    }
    const TabLanes lanes = power.whole ? raise(1 / most, power.least, power.whole) : raise(1 / most, power.least, power.beta);
    total = 0;
    for (int l = 0; l < TAB_LANES; ++l) up_to[l] = total += lanes[l];
    greedy = power.greedy;
    if (greedy) {
      largest = 0;
      for (int32_t i = 1; i < n; ++i)
        if (p[i] > p[largest]) largest = i;
    }
  }

  // The point of the uniform number u: first the lane, then the block. Sums are counted, not searched: no branch depends on them.
  int32_t draw(float u) const {
    if (greedy) return largest;
    float left = u * total, before = 0;  // left < total, being u < 1: the last lane is chosen only if something is there
    int32_t lane = 0;
    for (int l = 0; l < TAB_LANES - 1; ++l) {
      lane += left >= up_to[l];
      before = left >= up_to[l] ? up_to[l] : before;
    }
    left -= before;
    float sum = 0;
    int32_t found = lane;
    for (int32_t i = lane; i < n_pad; i += TAB_LANES) {
      sum += p[i];
      found += left >= sum ? TAB_LANES : 0;
    }
    if (found < n_pad) return found;
    do found -= TAB_LANES;  // rounding: the last one there is
    while (found > lane && p[found] <= 0);
    return found;
  }

 private:
  // p = (p inverse)^power; returns the sums of p over the points i = lane (mod 8).
  template <class P> TabLanes raise(float inverse, float least, P power) {
    TabLanes lanes{};
    const TabLanes zero{};
    for (int32_t i = 0; i < n_pad; i += TAB_LANES) {
      const TabLanes x = tab_load(p + i) * inverse, q = power_of(x >= least ? x : zero, power);
      tab_store(p + i, q);
      lanes += q;
    }
    return lanes;
  }
};

struct Memory {
  char* at;
  int64_t used = 0;
  template <class T> void take(T*& pointer, int64_t count) {
    pointer = reinterpret_cast<T*>(at + used);
    used += (count * static_cast<int64_t>(sizeof(T)) + 63) / 64 * 64;
  }
};

// Hands out the sampler's memory; returns how many bytes it takes.
int64_t lay_out(TabTtSampler* s, const TabTt* tab, int32_t capacity, void* memory) {
  Memory m{static_cast<char*>(memory)};
  for (int32_t k = 0; k < tab->d; ++k) {
    const int64_t size = static_cast<int64_t>(tt_r(tab, k)) * tab_pad(tt_n(tab, k));
    m.take(s->marginal[k], size);
    m.take(s->given[k], size);
  }
  m.take(s->pi, static_cast<int64_t>(tab->d + 1) * TAB_TT_MAX_R);
  m.take(s->row, static_cast<int64_t>(capacity) * TAB_TT_MAX_R);
  m.take(s->row_next, static_cast<int64_t>(capacity) * TAB_TT_MAX_R);
  m.take(s->order, capacity);
  m.take(s->order_next, capacity);
  m.take(s->point, capacity);
  m.take(s->parent, capacity);
  m.take(s->choice, capacity);
  m.take(s->alike, capacity);
  m.take(s->begin, capacity + 1);
  m.take(s->begin_next, capacity + 1);
  return m.used;
}

constexpr int32_t kBlock = 4;  // groups that share one pass over W, or over a slice

// p = row W for the groups first .. first + members
void weigh(const TabTtSampler& s, const TtCore& core, const float* W, int32_t first, int32_t members, Choice (&block)[kBlock]) {
  const float* rows[kBlock];
  float* p[kBlock];
  for (int32_t b = 0; b < kBlock; ++b) {
    const int32_t g = first + (b < members ? b : 0);
    rows[b] = s.row + static_cast<int64_t>(g) * TAB_TT_MAX_R;
    block[b].n = core.n;
    block[b].n_pad = tab_pad(core.n);
    p[b] = block[b].p;
  }
  if (members == 1) tt_rows_times<kTabFloat32, 1>(rows, core.rows, W, 0, block[0].n_pad, p);
  else tt_rows_times<kTabFloat32, kBlock>(rows, core.rows, W, 0, block[0].n_pad, p);
}

// Draws s.point for every sample of group g, and makes one new group of those that chose alike: counting sort from s.order to
// s.order_next. Returns the number of new groups so far.
int32_t split(TabTtSampler& s, const Choice& choice, int32_t g, int32_t k, uint64_t seed, int32_t nchild) {
  const int32_t begin = s.begin[g], end = s.begin[g + 1];
  for (int32_t i = begin; i < end; ++i) s.point[i] = choice.draw(tab_random_uniform(seed, s.order[i], k));
  if (end - begin == 1) {
    s.begin_next[nchild] = begin;
    s.parent[nchild] = g;
    s.choice[nchild] = s.point[begin];
    s.order_next[begin] = s.order[begin];
    return nchild + 1;
  }
  int32_t next[TAB_TT_MAX_N];
  std::memset(next, 0, sizeof(int32_t) * choice.n);
  for (int32_t i = begin; i < end; ++i) next[s.point[i]]++;
  for (int32_t point = 0, at = begin; point < choice.n; ++point) {
    if (!next[point]) continue;
    s.begin_next[nchild] = at;
    s.parent[nchild] = g;
    s.choice[nchild++] = point;
    at += next[point];
    next[point] = at - next[point];
  }
  for (int32_t i = begin; i < end; ++i) s.order_next[next[s.point[i]]++] = s.order[i];
  return nchild;
}

// row_next = row P^k[choice] for all new groups, those of the same choice together: each slice is read once, and asked for during the
// product before.
void descend(TabTtSampler& s, const TtCore& core, int32_t nchild) {
  if (nchild == 1) {
    tt_row_times_slice(core, s.choice[0], s.row, s.row_next);
    tt_rescale(s.row_next, core.width);
    return;
  }
  int32_t next[TAB_TT_MAX_N];
  std::memset(next, 0, sizeof(int32_t) * core.n);
  for (int32_t c = 0; c < nchild; ++c) next[s.choice[c]]++;
  for (int32_t point = 0, at = 0; point < core.n; ++point) {
    const int32_t alike = next[point];
    next[point] = at;
    at += alike;
  }
  for (int32_t c = 0; c < nchild; ++c) s.alike[next[s.choice[c]]++] = c;  // next: now where the following point begins
  for (int32_t first = 0; first < nchild;) {
    const int32_t point = s.choice[s.alike[first]];
    const float* row[kBlock];
    float* out[kBlock];
    const int32_t members = next[point] - first < kBlock ? next[point] - first : kBlock;
    for (int32_t b = 0; b < kBlock; ++b) {
      const int32_t c = s.alike[first + (b < members ? b : 0)];
      row[b] = s.row + static_cast<int64_t>(s.parent[c]) * TAB_TT_MAX_R;
      out[b] = s.row_next + static_cast<int64_t>(c) * TAB_TT_MAX_R;
    }
    const int32_t following = first + members < nchild ? s.choice[s.alike[first + members]] : point;
    const void* const ahead = following == point ? nullptr : core.address(following);
    if (members == 1) tt_rows_times_slice<1>(core, point, row, out, ahead);
    else if (members == 2) tt_rows_times_slice<2>(core, point, row, out, ahead);
    else tt_rows_times_slice<kBlock>(core, point, row, out, ahead);
    for (int32_t b = 0; b < members; ++b) tt_rescale(out[b], core.width);
    first += members;
  }
}

template <class T> void swap(T& a, T& b) {
  const T c = a;
  a = b;
  b = c;
}

}  // namespace

extern "C" {

int64_t tab_tt_sampler_bytes(const TabTt* tab, int32_t capacity) {
  TabTtSampler unused;
  return lay_out(&unused, tab, capacity, nullptr);
}

TabStatus tab_tt_init(TabTtSampler* s, const TabTt* tab, int32_t capacity, void* memory, int64_t bytes) {
  std::memset(s, 0, sizeof *s);
  s->tab = tab;
  if (capacity < 1 || !memory || bytes < tab_tt_sampler_bytes(tab, capacity)) return kTabBad;
  s->capacity = capacity;
  lay_out(s, tab, capacity, memory);
  std::memset(s->pi, 0, sizeof(float) * (tab->d + 1) * TAB_TT_MAX_R);
  s->pi[tab->d * TAB_TT_MAX_R] = 1;
  int64_t end = 0;
  for (int32_t k = 0; k < tab->d; ++k) end += tt_core(tab, k, 0).size();
  for (int32_t k = tab->d - 1; k >= 0; --k) {
    TtCore core = tt_core(tab, k, 0);
    core.offset = end -= core.size();
    marginal_of(core, s->pi + (k + 1) * TAB_TT_MAX_R, s->marginal[k], s->pi + k * TAB_TT_MAX_R);
  }
  return kTabOk;
}

TabStatus tab_tt_condition(TabTtSampler* s, const double* x, const bool* fixed) {
  const TabTt* tab = s->tab;
  const int32_t d = tab->d;
  TabStatus status = kTabOk;
  for (int32_t k = 0; k < d; ++k) {
    if (!fixed[k]) continue;
    if (!std::isfinite(static_cast<float>(x[k]))) return kTabNotFinite;
    if (x[k] < tab_lo(&tab->head)[k] || x[k] > tab_hi(&tab->head)[k]) status = kTabOutside;
  }
  int32_t first_free = d, last_fixed = -1;
  int64_t end = 0;
  for (int32_t k = 0; k < d; ++k) {
    s->fixed[k] = fixed[k];
    s->x[k] = fixed[k] ? x[k] : 0.0;
    s->use_given[k] = false;
    if (fixed[k]) last_fixed = k;
    else if (first_free == d) first_free = k;
    end += tt_core(tab, k, 0).size();
  }
  // pi_k and W_k under the fixed variables, from the last of them to the first free one
  alignas(64) float pi[2][TAB_TT_MAX_R];
  int now = 0;
  for (int32_t k = d - 1; k >= first_free; --k) {
    TtCore core = tt_core(tab, k, 0);
    core.offset = end -= core.size();
    if (k > last_fixed) continue;
    if (k == last_fixed) std::memcpy(pi[now], s->pi + (k + 1) * TAB_TT_MAX_R, sizeof pi[now]);
    float* next = pi[1 - now];
    if (fixed[k]) {
      const TtPoint at = tt_point(tab, k, x[k]);
      float b[TAB_TT_MAX_R];
      std::memset(next, 0, sizeof pi[0]);
      tt_slice_times_column(core, at.i, pi[now], next, 1);
      if (at.t != 0.0f) {
        tt_slice_times_column(core, at.i + 1, pi[now], b, 1);
        for (int32_t j = 0; j < core.rows; ++j) next[j] = (1 - at.t) * next[j] + at.t * b[j];
      }
      tt_rescale(next, core.rows);
    } else {
      marginal_of(core, pi[now], s->given[k], next);
      s->use_given[k] = true;
    }
    now = 1 - now;
  }
  return status;
}

TabStatus tab_tt_sample(TabTtSampler* s, double alpha, int32_t count, uint64_t seed, double* x, double* log_prob) {
  const TabTt* tab = s->tab;
  const int32_t d = tab->d;
  if (count < 1 || count > s->capacity || !(alpha == alpha)) return kTabBad;
  const Power power(alpha);
  int32_t last_free = -1;
  for (int32_t k = 0; k < d; ++k)
    if (!s->fixed[k]) last_free = k;

  // one group: no sample has chosen anything yet
  int32_t ngroup = 1;
  s->begin[0] = 0;
  s->begin[1] = count;
  s->row[0] = 1;
  for (int32_t i = 0; i < count; ++i) {
    s->order[i] = i;
    if (log_prob) log_prob[i] = 0;
  }
  Choice block[kBlock];
  int64_t offset = 0;
  for (int32_t k = 0; k < d; ++k) {
    const TtCore core = tt_core(tab, k, offset);
    offset += core.size();
    if (s->fixed[k]) {
      for (int32_t i = 0; i < count; ++i) x[static_cast<int64_t>(i) * d + k] = s->x[k];
      const TtPoint at = tt_point(tab, k, s->x[k]);
      for (int32_t g = 0; g < ngroup && k < last_free; ++g) {
        float* out = s->row_next + static_cast<int64_t>(g) * TAB_TT_MAX_R;
        row_at(core, at, s->row + static_cast<int64_t>(g) * TAB_TT_MAX_R, out);
        tt_rescale(out, core.columns);
      }
      swap(s->row, s->row_next);
      continue;
    }

    const float* W = s->use_given[k] ? s->given[k] : s->marginal[k];
    const double lo = tab_lo(&tab->head)[k], hi = tab_hi(&tab->head)[k], step = core.n > 1 ? (hi - lo) / (core.n - 1) : 0.0;
    int32_t nchild = 0;
    for (int32_t first = 0; first < ngroup; first += kBlock) {
      const int32_t members = ngroup - first < kBlock ? ngroup - first : kBlock;
      weigh(*s, core, W, first, members, block);
      for (int32_t b = 0; b < members; ++b) block[b].prepare(power);
      for (int32_t b = 0; b < members; ++b) {
        nchild = split(*s, block[b], first + b, k, seed, nchild);
        for (int32_t i = s->begin[first + b]; i < s->begin[first + b + 1]; ++i) {
          const int32_t sample = s->order[i], point = s->point[i];
          x[static_cast<int64_t>(sample) * d + k] = lo + point * step;
          if (log_prob && !power.greedy) log_prob[sample] += std::log(static_cast<double>(block[b].p[point]) / block[b].total);
        }
      }
    }
    s->begin_next[nchild] = count;
    if (k < last_free) descend(*s, core, nchild);
    swap(s->row, s->row_next);
    swap(s->order, s->order_next);
    swap(s->begin, s->begin_next);
    ngroup = nchild;
  }
  return kTabOk;
}

}  // extern "C"
