#include "controller/tab/tab_mlp.h"

#include "controller/tab/tab_lanes.h"

#include <cmath>

using namespace engram;

namespace {

// One layer of `n` inputs: y = b + scale W' z, `vectors` vectors of outputs at a time to hide the latency of the additions.
template <int type, int vectors>
void columns(const void* weight, int64_t first, int32_t stride, const float* scale, const float* bias, int32_t n, const float* z, float* y) {
  TabLanes sum[vectors] = {};
  for (int32_t i = 0; i < n; ++i) {
    for (int v = 0; v < vectors; ++v) sum[v] += tab_load_as<type>(weight, first + static_cast<int64_t>(i) * stride + v * TAB_LANES) * z[i];
  }
  for (int v = 0; v < vectors; ++v) {
    const int32_t j = v * TAB_LANES;
    tab_store(y + j, tab_load(bias + j) + tab_load(scale + j) * sum[v]);
  }
}

template <int type>
void layer(const void* weight, int64_t first, int32_t n_pad, const float* scale, const float* bias, int32_t n, const float* z, float* y) {
  int32_t j = 0;
  for (; j + 4 * TAB_LANES <= n_pad; j += 4 * TAB_LANES) columns<type, 4>(weight, first + j, n_pad, scale + j, bias + j, n, z, y + j);
  for (; j < n_pad; j += TAB_LANES) columns<type, 1>(weight, first + j, n_pad, scale + j, bias + j, n, z, y + j);
}

// out: all numbers of a member's last layer, for x inside what a float holds
void run(const TabMlp* tab, int32_t member, const double* x, float* out) {
  alignas(64) float z[2][TAB_MLP_MAX_WIDTH];
  for (int32_t i = 0; i < tab->d; ++i) {
    z[0][i] = std::fmin(std::fmax((static_cast<float>(x[i]) - tab->center[i]) * tab->inv_width[i], -TAB_FAR), TAB_FAR);
  }
  const int32_t hidden_pad = tab_pad(tab->hidden), out_pad = tab_pad(tab_mlp_width_out(tab));
  int64_t first = member * (tab_mlp_weights(tab) / tab->members), bias = member * (tab_mlp_biases(tab) / tab->members);
  tab_with_type(tab->weight_type, [&](auto type) {
    int32_t n = tab->d;
    for (int32_t l = 0; l < tab->depth; ++l) {
      float* const y = z[(l + 1) % 2];
      layer<type>(tab->weight, first, hidden_pad, tab->weight_scale + bias, tab->bias + bias, n, z[l % 2], y);
      for (int32_t j = 0; j < hidden_pad; ++j) y[j] = y[j] > 0 ? y[j] : 0;
      first += static_cast<int64_t>(n) * hidden_pad;
      bias += hidden_pad;
      n = tab->hidden;
    }
    layer<type>(tab->weight, first, out_pad, tab->weight_scale + bias, tab->bias + bias, n, z[tab->depth % 2], out);
  });
}

// p (n): probabilities from logits.
void softmax(int32_t n, const float* logit, double* p) {
  double largest = -INFINITY, sum = 0;
  for (int32_t i = 0; i < n; ++i) largest = std::fmax(largest, logit[i]);
  for (int32_t i = 0; i < n; ++i) sum += p[i] = std::exp(logit[i] - largest);
  for (int32_t i = 0; i < n; ++i) p[i] /= sum;
}

// f(index, weight, y (m), log standard deviations (m) or null) for every answer of every member.
template <class F> void for_each_part(const TabMlp* tab, const double* x, F f) {
  const int32_t modes = tab->modes, m = tab->m;
  for (int32_t member = 0; member < tab->members; ++member) {
    alignas(64) float out[TAB_MLP_MAX_WIDTH];
    run(tab, member, x, out);
    if (modes == 0) {
      f(member, 1.0 / tab->members, out, static_cast<const float*>(nullptr));
      continue;
    }
    double p[TAB_MLP_MAX_PARTS];
    softmax(modes, out, p);
    for (int32_t k = 0; k < modes; ++k) f(member * modes + k, p[k] / tab->members, out + modes + k * m, out + modes + (modes + k) * m);
  }
}

float variance(const float* log_std, int32_t j) { return log_std ? std::exp(2 * log_std[j]) : INFINITY; }

void clear(float* v, int32_t n) {
  if (v) std::memset(v, 0, sizeof(float) * n);
}

}  // namespace

extern "C" {

TabStatus tab_mlp_eval(const TabMlp* tab, int32_t member, const double* x, float* out) {
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite) clear(out, tab_pad(tab_mlp_width_out(tab)));
  else run(tab, member, x, out);
  return status;
}

TabStatus tab_mlp_moments(const TabMlp* tab, const double* x, float* mean, float* var) {
  const int32_t m_pad = tab_pad(tab->m);
  clear(mean, m_pad);
  clear(var, m_pad);
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite) return status;
  double weight = 0;
  for_each_part(tab, x, [&](int32_t, double h, const float* y, const float* log_std) {
    if (h == 0) return;
    // running mean and variance, as in tab_gmr_moments; without a head an answer has no variance of its own
    const double total = weight + h;
    const float share = static_cast<float>(h / total), rest = static_cast<float>(weight / total);
    for (int32_t j = 0; j < tab->m; ++j) {
      const float delta = y[j] - mean[j];
      mean[j] += share * delta;
      if (var) var[j] = rest * var[j] + share * ((log_std ? variance(log_std, j) : 0) + rest * delta * delta);
    }
    weight = total;
  });
  return status;
}

TabStatus tab_mlp_modes(const TabMlp* tab, const double* x, int32_t count, int32_t* index, float* weight, float* y, float* var) {
  const int32_t m = tab->m, m_pad = tab_pad(m);
  for (int32_t i = 0; i < count; ++i) {
    index[i] = -1;
    weight[i] = 0;
    clear(y + static_cast<int64_t>(i) * m_pad, m_pad);
    clear(var ? var + static_cast<int64_t>(i) * m_pad : nullptr, m_pad);
  }
  const TabStatus status = tab_domain(&tab->head, x);
  if (status == kTabNotFinite || count < 1) return status;
  for_each_part(tab, x, [&](int32_t part, double h, const float* mean, const float* log_std) {
    const float p = static_cast<float>(h);
    int32_t at = count;
    while (at > 0 && (index[at - 1] < 0 || p > weight[at - 1])) --at;
    if (at == count) return;
    for (int32_t i = count - 1; i > at; --i) {
      index[i] = index[i - 1];
      weight[i] = weight[i - 1];
      std::memcpy(y + static_cast<int64_t>(i) * m_pad, y + static_cast<int64_t>(i - 1) * m_pad, sizeof(float) * m_pad);
      if (var) std::memcpy(var + static_cast<int64_t>(i) * m_pad, var + static_cast<int64_t>(i - 1) * m_pad, sizeof(float) * m_pad);
    }
    index[at] = part;
    weight[at] = p;
    for (int32_t j = 0; j < m; ++j) {
      y[static_cast<int64_t>(at) * m_pad + j] = mean[j];
      if (var) var[static_cast<int64_t>(at) * m_pad + j] = variance(log_std, j);
    }
  });
  return status;
}

}  // extern "C"
