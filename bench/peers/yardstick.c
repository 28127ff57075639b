// What one core can do at best: multiply-adds from registers, and bytes from memory of a given size. Compiled by
// roofline.py for the very machine it runs on, called by way of ctypes; every function returns processor seconds.
#define _GNU_SOURCE
#include <stddef.h>
#include <time.h>

#if defined(__AVX512F__)
enum { kVectorBytes = 64 };
#elif defined(__AVX__)
enum { kVectorBytes = 32 };
#else
enum { kVectorBytes = 16 };
#endif

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

size_t vector_bytes(void) {
  return kVectorBytes;
}

// Independent chains: more than the latency of a multiply-add times what can begin in a cycle.
enum { kChains = 12 };

typedef float vector_f32 __attribute__((vector_size(kVectorBytes)));
typedef double vector_f64 __attribute__((vector_size(kVectorBytes)));

#define MULTIPLY_ADDS(name, type)                                                                     \
  double name(long rounds) {                                                                          \
    const type zero = {0}, factor = zero + 0.5f, term = zero + 0.25f;                                 \
    type chain[kChains];                                                                              \
    for (int k = 0; k < kChains; ++k) chain[k] = zero + 1.0f;                                         \
    const double begin = now();                                                                       \
    for (long round = 0; round < rounds; ++round)                                                     \
      _Pragma("GCC unroll 12") for (int k = 0; k < kChains; ++k) chain[k] = chain[k] * factor + term; \
    const double spent = now() - begin;                                                               \
    volatile type sink = zero;                                                                        \
    for (int k = 0; k < kChains; ++k) sink = sink + chain[k];                                         \
    return spent;                                                                                     \
  }

MULTIPLY_ADDS(multiply_adds_f32, vector_f32)
MULTIPLY_ADDS(multiply_adds_f64, vector_f64)
MULTIPLY_ADDS(multiply_adds_one_f32, float)
MULTIPLY_ADDS(multiply_adds_one_f64, double)

// a = b + factor c over arrays of `count` vectors: two are read and one is written.
double triad(vector_f32* a, const vector_f32* b, const vector_f32* c, size_t count, long rounds) {
  const vector_f32 zero = {0}, factor = zero + 0.5f;
  const double begin = now();
  for (long round = 0; round < rounds; ++round) {
#pragma GCC unroll 8
    for (size_t i = 0; i < count; ++i) a[i] = b[i] + factor * c[i];
    __asm__ volatile("" ::: "memory");
  }
  return now() - begin;
}

// Sum of b_i c_i: two arrays are read, nothing is written. What a sweep does to the matrix.
double read_two(const vector_f32* b, const vector_f32* c, size_t count, long rounds) {
  const vector_f32 zero = {0};
  vector_f32 sum[8] = {zero, zero, zero, zero, zero, zero, zero, zero};
  const double begin = now();
  for (long round = 0; round < rounds; ++round) {
    for (size_t i = 0; i + 8 <= count; i += 8)
      _Pragma("GCC unroll 8") for (int k = 0; k < 8; ++k) sum[k] += b[i + (size_t)k] * c[i + (size_t)k];
    __asm__ volatile("" ::: "memory");
  }
  const double spent = now() - begin;
  volatile vector_f32 sink = zero;
  for (int k = 0; k < 8; ++k) sink = sink + sum[k];
  return spent;
}
