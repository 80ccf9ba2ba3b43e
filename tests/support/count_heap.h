// Counts every call of the process's allocators while `counting` is set. For the one source file of a test program.
#ifndef TESTS_SUPPORT_COUNT_HEAP_H_
#define TESTS_SUPPORT_COUNT_HEAP_H_

#include <atomic>
#include <cerrno>
#include <cstddef>

// glibc's own allocator, behind the names that this program takes over.
extern "C" {
void* __libc_malloc(size_t);
void* __libc_calloc(size_t, size_t);
void* __libc_realloc(void*, size_t);
void* __libc_memalign(size_t, size_t);
void __libc_free(void*);
}

namespace {
std::atomic<bool> counting{false};
std::atomic<long long> calls{0};
void count() {
  if (counting) ++calls;
}
}  // namespace

extern "C" {
void* malloc(size_t n) { return count(), __libc_malloc(n); }
void* calloc(size_t n, size_t m) { return count(), __libc_calloc(n, m); }
void* realloc(void* p, size_t n) { return count(), __libc_realloc(p, n); }
void* memalign(size_t a, size_t n) { return count(), __libc_memalign(a, n); }
void* aligned_alloc(size_t a, size_t n) { return count(), __libc_memalign(a, n); }
int posix_memalign(void** p, size_t a, size_t n) { return count(), (*p = __libc_memalign(a, n)) ? 0 : ENOMEM; }
void free(void* p) {
  if (p) count();
  __libc_free(p);
}
}

#endif  // TESTS_SUPPORT_COUNT_HEAP_H_
