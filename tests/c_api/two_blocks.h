#pragma once

#include "stiction.h"

/* Two blocks of 1 kg on the floor, pushed sideways by 2 N and 6 N; mu = 0.5. By hand: mu m g = 4.905 N holds the first
 * one, whose friction is -2 N; the second one slides at 6 - 4.905 = 1.095 m/s2. Each array once, in both precisions. */
static const int64_t kEnvRows[] = {0, 3, 6}, kEnvCones[] = {0, 1, 2}, kRows[] = {0, 1, 2, 3, 4, 5, 6};
static const uint8_t kKinds[] = {STICTION_CONE_FRICTION, STICTION_CONE_FRICTION};
static const int32_t kColumns[] = {0, 1, 2, 0, 1, 2};
static const double kA[] = {1, 1, 1, 1, 1, 1}, kB[] = {-9.81, 2, 0, -9.81, 6, 0}, kMu[] = {0, 0.5, 0.5, 0, 0.5, 0.5};
static const double kZeros[6] = {0};
static const float kFloatA[] = {1, 1, 1, 1, 1, 1}, kFloatB[] = {-9.81f, 2, 0, -9.81f, 6, 0};
static const float kFloatMu[] = {0, 0.5f, 0.5f, 0, 0.5f, 0.5f}, kFloatZeros[6] = {0};

static const double kReactions[] = {9.81, -2, 0, 9.81, -4.905, 0}, kMotion[] = {0, 0, 0, 0, 1.095, 0};

static void two_blocks(stiction_batch_view* batch, int32_t precision) {
  const int wide = precision == STICTION_F64;
  stiction_batch_view_init(batch, sizeof *batch);
  batch->precision = precision;
  batch->law = STICTION_LAW_COULOMB;
  batch->env_count = 2;
  batch->cone_count = 2;
  batch->row_count = 6;
  batch->nonzero_count = 6;
  batch->env_row_offsets = kEnvRows;
  batch->env_cone_offsets = kEnvCones;
  batch->cone_kind = kKinds;
  batch->cone_row_offsets = kEnvRows;
  batch->row_offsets = kRows;
  batch->column = kColumns;
  batch->A = wide ? (const void*)kA : (const void*)kFloatA;
  batch->b = wide ? (const void*)kB : (const void*)kFloatB;
  batch->mu = wide ? (const void*)kMu : (const void*)kFloatMu;
  batch->R = batch->lo = batch->hi = wide ? (const void*)kZeros : (const void*)kFloatZeros;
}
