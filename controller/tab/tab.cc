#include "controller/tab/tab.h"

#include "controller/tab/tab_gmr.h"
#include "controller/tab/tab_gpr.h"
#include "controller/tab/tab_knn.h"
#include "controller/tab/tab_logit.h"
#include "controller/tab/tab_mlp.h"
#include "controller/tab/tab_pca.h"
#include "controller/tab/tab_rbf.h"
#include "controller/tab/tab_sdf.h"
#include "controller/tab/tab_tt.h"

#include <cmath>
#include <cstring>

namespace {

// Text without stdio: appends to a buffer of TAB_TEXT bytes and cuts what does not fit.
struct Text {
  char* p;
  int n = 0;
  Text& operator<<(const char* s) {
    while (s && *s && n < TAB_TEXT - 1) p[n++] = *s++;
    p[n] = 0;
    return *this;
  }
  Text& operator<<(uint64_t h) {
    char hex[19] = "0x";
    for (int i = 0; i < 16; ++i) hex[2 + i] = "0123456789abcdef"[(h >> (60 - 4 * i)) & 15];
    return *this << hex;
  }
};

// A tensor train whose points and ranks are whole numbers within their bounds, and whose cores are all there.
bool tt_sizes_fit(const TabTt& t) {
  if (t.d != t.head.nin || t.head.nout != 1 || t.head.narray != 5 || t.head.array[2].count != 2 * static_cast<uint64_t>(t.d) + 1 ||
      t.head.array[3].count != static_cast<uint64_t>(t.d) || (t.type != kTabFloat32 && t.type != kTabInt8))
    return false;
  const auto whole = [&t](int i, int most) { return t.shape[i] >= 1 && t.shape[i] <= most && t.shape[i] == std::floor(t.shape[i]); };
  const float* rank = t.shape + t.d;
  int64_t numbers = 0;
  for (int k = 0; k < t.d; ++k) {
    if (!whole(k, TAB_TT_MAX_N) || !whole(t.d + k, TAB_TT_MAX_R) || !whole(t.d + k + 1, TAB_TT_MAX_R)) return false;
    numbers += int64_t(t.shape[k]) * int64_t(rank[k]) * tab_tt_width(int32_t(rank[k + 1]));
  }
  return rank[0] == 1 && rank[t.d] == 1 && static_cast<int64_t>(t.head.array[4].count) == tab_words(t.type, numbers);
}

// Do the array counts fit the kind's own sizes?
bool sizes_fit(const TabHead& h) {
  const auto count = [&h](int i) { return i < h.narray ? static_cast<int64_t>(h.array[i].count) : -1; };
  const int most_in = h.kind == kTabTt ? int{TAB_TT_MAX_D} : int{TAB_MAX_IN};
  if (h.nin < 1 || h.nin > most_in || h.nout < 1 || h.narray > TAB_ARRAYS || count(0) != h.nin || count(1) != h.nin) return false;
  for (int i = 0; i < h.narray; ++i)
    if (!h.array[i].data) return false;
  switch (h.kind) {
    case kTabKnn: {
      const TabKnn& t = reinterpret_cast<const TabKnn&>(h);
      return t.n > 0 && t.d == h.nin && t.m == h.nout && count(2) == t.d && count(3) == int64_t{tab_pad(t.n)} * t.d &&
             count(4) == int64_t{t.n} * tab_pad(t.m);
    }
    case kTabGpr: {
      const TabGpr& t = reinterpret_cast<const TabGpr&>(h);
      return t.n > 0 && t.n <= TAB_GPR_MAX_N && t.d == h.nin && t.m == h.nout && count(2) == t.d &&
             count(3) == int64_t{tab_pad(t.n)} * t.d && count(4) == int64_t{t.n} * tab_pad(t.m) && count(5) == tab_pad(t.m) &&
             (count(6) == tab_gpr_linv_size(t.n) || (!t.linv && count(6) < 0));
    }
    case kTabPca: {
      const TabPca& t = reinterpret_cast<const TabPca&>(h);
      return t.m == h.nin && t.n == h.nout && count(2) == tab_pad(t.n) && count(3) == int64_t{t.m} * tab_pad(t.n);
    }
    case kTabRbf: {
      const TabRbf& t = reinterpret_cast<const TabRbf&>(h);
      return h.nin == 1 && t.k > 0 && t.k <= TAB_RBF_MAX_K && t.nchannel == h.nout && t.width > 0 && count(2) == tab_pad(t.k);
    }
    case kTabLogit: {
      const TabLogit& t = reinterpret_cast<const TabLogit&>(h);
      return t.d == h.nin && h.nout == 1 && count(2) == t.d;
    }
    case kTabTt: return tt_sizes_fit(reinterpret_cast<const TabTt&>(h));
    case kTabGmr: {
      const TabGmr& t = reinterpret_cast<const TabGmr&>(h);
      const int64_t k = t.k, m_pad = tab_pad(t.m);
      return k > 0 && k <= TAB_GMR_MAX_K && t.d == h.nin && t.m == h.nout && t.m <= TAB_GMR_MAX_M && count(2) == tab_pad(t.k) &&
             count(3) == tab_pad(t.k) && count(4) == k * tab_pad(t.d) && count(5) == k * t.d * tab_pad(t.d) && count(6) == k * m_pad &&
             count(7) == tab_words(t.slope_type, k * t.d * m_pad) && count(8) == m_pad && count(9) == k * m_pad;
    }
    case kTabMlp: {
      const TabMlp& t = reinterpret_cast<const TabMlp&>(h);
      return t.d == h.nin && t.m == h.nout && t.depth > 0 && t.depth <= TAB_MLP_MAX_DEPTH && t.hidden > 0 && t.members > 0 &&
             t.modes >= 0 && tab_pad(t.hidden) <= TAB_MLP_MAX_WIDTH && int64_t{t.modes} * (1 + 2 * int64_t{t.m}) <= TAB_MLP_MAX_WIDTH &&
             t.m <= TAB_MLP_MAX_WIDTH && int64_t{t.members} * (t.modes + (t.modes == 0)) <= TAB_MLP_MAX_PARTS && count(2) == t.d &&
             count(3) == t.d && count(4) == tab_words(t.weight_type, tab_mlp_weights(&t)) && count(5) == tab_mlp_biases(&t) &&
             count(6) == tab_mlp_biases(&t);
    }
    case kTabSdf: {
      const TabSdf& t = reinterpret_cast<const TabSdf&>(h);
      const auto blocks = [](int32_t n) { return int64_t{n > 0 ? tab_pad(n) : TAB_LANES}; };
      const bool grid = t.nx > 0;
      return h.nin == 3 && h.nout == 1 && t.nbox >= 0 && t.nsphere >= 0 && count(2) == blocks(t.nbox) * TAB_SDF_BOX &&
             count(3) == blocks(t.nsphere) * TAB_SDF_SPHERE && t.nx >= 0 && (!grid || (t.nx > 1 && t.ny > 1 && t.nz > 1 && t.spacing > 0)) &&
             count(4) == (grid ? tab_words(t.grid_type, int64_t{tab_pad(t.nx)} * t.ny * t.nz) : int64_t{TAB_LANES});
    }
    default: return false;
  }
}

uint64_t fnv1a(uint64_t hash, uint32_t word) { return (hash ^ word) * 0x100000001b3u; }

}  // namespace

extern "C" {

uint64_t tab_digest(const TabHead* head) {
  uint64_t hash = 0xcbf29ce484222325u;
  for (int i = 0; i < head->narray; ++i) {
    const TabArray& a = head->array[i];
    hash = fnv1a(fnv1a(hash, static_cast<uint32_t>(a.count)), static_cast<uint32_t>(a.count >> 32));
    for (uint64_t j = 0; j < a.count; ++j) {
      uint32_t word;
      std::memcpy(&word, static_cast<const char*>(a.data) + 4 * j, sizeof word);
      hash = fnv1a(hash, word);
    }
  }
  return hash;
}

TabStatus tab_check(const TabHead* head, TabKind kind, uint64_t robot_digest, uint64_t task_digest, char* text) {
  Text out{text};
  out << "";
  if (!head) {
    out << "no " << tab_kind_text(kind) << " table was given; run 'make tables' and link its library";
    return kTabBad;
  }
  out << tab_kind_text(kind) << " table '" << (head->name ? head->name : "?") << "' ";
  if (head->schema != tab_schema(head->kind) && tab_schema(head->kind) != 0) {
    out << "has schema " << uint64_t{head->schema} << ", this controller reads " << uint64_t{tab_schema(head->kind)};
  } else if (head->kind != static_cast<uint32_t>(kind)) {
    out << "is of another kind: " << tab_kind_text(head->kind);
  } else if (robot_digest && head->robot_digest != robot_digest) {
    out << "was made for another robot: its digest is " << head->robot_digest << ", expected " << robot_digest;
  } else if (task_digest && head->task_digest != task_digest) {
    out << "was made for another task: its digest is " << head->task_digest << ", expected " << task_digest;
  } else if (!sizes_fit(*head)) {
    out << "has array sizes that contradict each other";
  } else if (const uint64_t digest = tab_digest(head); digest != head->digest) {
    out << "is damaged: the data's digest is " << digest << ", expected " << head->digest;
  } else {
    text[0] = 0;
    return kTabOk;
  }
  out << "; run 'make tables' and build again";
  return kTabBad;
}

TabStatus tab_domain(const TabHead* head, const double* x) {
  const float* lo = tab_lo(head);
  const float* hi = tab_hi(head);
  TabStatus status = kTabOk;
  for (int i = 0; i < head->nin; ++i) {
    // as a float the query may overflow where the double does not
    if (!std::isfinite(static_cast<float>(x[i]))) return kTabNotFinite;
    if (x[i] < lo[i] || x[i] > hi[i]) status = kTabOutside;
  }
  return status;
}

uint32_t tab_schema(uint32_t kind) {
  switch (kind) {
    case kTabKnn: return TAB_KNN_SCHEMA;
    case kTabGpr: return TAB_GPR_SCHEMA;
    case kTabPca: return TAB_PCA_SCHEMA;
    case kTabRbf: return TAB_RBF_SCHEMA;
    case kTabLogit: return TAB_LOGIT_SCHEMA;
    case kTabGmr: return TAB_GMR_SCHEMA;
    case kTabMlp: return TAB_MLP_SCHEMA;
    case kTabSdf: return TAB_SDF_SCHEMA;
    case kTabTt: return TAB_TT_SCHEMA;
  }
  return 0;
}

const char* tab_kind_text(uint32_t kind) {
  switch (kind) {
    case kTabKnn: return "k-NN";
    case kTabGpr: return "GPR";
    case kTabPca: return "PCA";
    case kTabRbf: return "RBF";
    case kTabLogit: return "logit";
    case kTabTt: return "tensor train";
    case kTabGmr: return "GMR";
    case kTabMlp: return "MLP";
    case kTabSdf: return "SDF";
  }
  return "unknown";
}

const char* tab_status_text(TabStatus status) {
  switch (status) {
    case kTabOk: return "ok";
    case kTabOutside: return "outside the table's domain";
    case kTabNotFinite: return "input not finite";
    case kTabBad: return "bad table";
  }
  return "unknown";
}

}  // extern "C"
