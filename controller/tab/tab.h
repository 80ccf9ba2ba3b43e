/* Tables: read-only data compiled offline, and what all kinds of them have in common. Plain C11; knows no robot.
 *
 * A table is one `const` struct of its kind (tab_knn.h, tab_gpr.h, ...) whose first member is a TabHead. Its data are arrays
 * of 32-bit floats, some of them stored smaller where the kind allows it (TabType), padded to TAB_LANES and aligned to 64 bytes, so
 * that every evaluator's inner loop is a run of full vectors.
 * Evaluators never allocate, never fail silently and answer outside the domain too, but say so in their TabStatus.
 */
#ifndef CONTROLLER_TAB_TAB_H_
#define CONTROLLER_TAB_TAB_H_

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  TAB_LANES = 8,     /* floats in a vector: rows and blocks are padded to it */
  TAB_ARRAYS = 12,   /* most arrays in one table */
  TAB_MAX_IN = 64,   /* most inputs of a table: bounds the evaluators' scratch */
  TAB_TEXT = 256,    /* bytes that hold any text of tab_check */
};
#define TAB_FAR 1e15f /* scaled input of a padding sample: farther than any query, its square still finite */

typedef enum TabKind {
  kTabKnn = 1, kTabGpr = 2, kTabPca = 3, kTabRbf = 4, kTabLogit = 5, kTabGmr = 6, kTabMlp = 7, kTabSdf = 8, kTabTt = 10
} TabKind;

typedef enum TabStatus {
  kTabOk = 0,
  kTabOutside = 1,   /* an input lies outside the domain: the answer is an extrapolation */
  kTabNotFinite = 2, /* an input is NaN or infinite: outputs are set to a neutral value the evaluator names */
  kTabBad = 3,       /* the table does not belong here, or its bytes have changed (tab_check only) */
} TabStatus;

/* How the numbers of an array are stored; which arrays may be smaller than float32, and of which type they are, the kind's struct says. */
typedef enum TabType {
  kTabFloat32 = 0,
  kTabFloat16 = 1, /* IEEE half precision without denormals: 11 bits, 6.1e-5 .. 65504 */
  kTabInt8 = 2,    /* -127 .. 127, times a scale that the kind's struct holds */
} TabType;

/* One array of a table: `count` 32-bit words, whatever its type. */
typedef struct TabArray {
  const char* name;
  const void* data;
  uint64_t count;
} TabArray;

typedef struct TabHead {
  uint32_t schema;        /* tab_schema(kind) of the generator */
  uint32_t kind;          /* TabKind */
  const char* name;       /* C symbol of the table */
  uint64_t digest;        /* tab_digest of the arrays */
  uint64_t robot_digest;  /* of the robot the data were solved on */
  uint64_t task_digest;   /* of the task they were solved for */
  int32_t nin, nout;      /* inputs and outputs */
  const char* const* input_name; /* (nin) */
  const char* const* input_unit; /* (nin) */
  float held_out_error;          /* on samples the fit has not seen, in the unit that the next field names */
  const char* held_out_text;     /* what was measured, on how many samples */
  const char* provenance;        /* the command and the data set the table was made from */
  int32_t narray;
  TabArray array[TAB_ARRAYS];    /* array[0], array[1]: domain lo and hi (nin each); then the kind's own */
} TabHead;

/* FNV-1a over the arrays' counts and their 32-bit words: every single-word change alters it. Init only.
 * O(words): about 1 ns each. */
uint64_t tab_digest(const TabHead* head);

/* Is this the table we expect? kTabOk, or kTabBad with one sentence in text (TAB_TEXT bytes, always terminated) that names the
 * table, what differs and the mend. Compares schema, kind, robot and task digest, recomputes the data digest and checks that the
 * array sizes fit the kind. An expected digest of 0 accepts any. Init only. */
TabStatus tab_check(const TabHead* head, TabKind kind, uint64_t robot_digest, uint64_t task_digest, char* text);

/* Domain of the inputs (nin), in the units of input_unit. */
static inline const float* tab_lo(const TabHead* head) { return (const float*)head->array[0].data; }
static inline const float* tab_hi(const TabHead* head) { return (const float*)head->array[1].data; }

/* kTabOk, kTabOutside or kTabNotFinite for the inputs x (nin), in the units of input_unit. */
TabStatus tab_domain(const TabHead* head, const double* x);

/* The worse of two statuses. */
static inline TabStatus tab_worse(TabStatus a, TabStatus b) { return a > b ? a : b; }

/* n rounded up to whole vectors. */
static inline int32_t tab_pad(int32_t n) { return (n + TAB_LANES - 1) / TAB_LANES * TAB_LANES; }

/* 32-bit words that hold `count` numbers of a type. */
static inline int64_t tab_words(int32_t type, int64_t count) {
  const int64_t size = type == kTabFloat32 ? 4 : type == kTabFloat16 ? 2 : 1;
  return (count * size + 3) / 4;
}

/* The schema of a kind that these evaluators read: TAB_KNN_SCHEMA, ...; 0 for a kind that they do not know. */
uint32_t tab_schema(uint32_t kind);

const char* tab_kind_text(uint32_t kind); /* TabKind */
const char* tab_status_text(TabStatus status);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_H_ */
