#pragma once

#include "stiction/warm_start.hpp"

namespace stiction {

/// A cone as the store knows it. Rows ascend with cones, so (id, row) is unique even where ids are not.
struct WarmStartEntry {
  std::uint64_t id;
  Index row;          ///< first row, within the environment
  ConeKind kind;      ///< a cone of another kind ...
  std::uint8_t rows;  ///< ... or size is another cone
  std::uint16_t hit;  ///< while loading: 1 if this cone starts from a stored reaction
};
static_assert(sizeof(WarmStartEntry) == 16);

/// Slot of one environment's stored cones.
struct WarmStartSlot {
  Offset first_cone;  ///< in WarmStartMemory::stored
  Offset first_row;   ///< in WarmStartMemory::lambda
  double dt;          ///< step they were solved for [s]
  Index cones;        ///< 0: nothing is stored
  Index reserved;     ///< zero
};
static_assert(sizeof(WarmStartSlot) == 32);

/// The store's memory, on the machine that solves. An environment's part of an array begins where its cones or rows
/// begin in the batch, so nothing has to be allotted.
template <class Real>
struct WarmStartMemory {
  Offset env_capacity = 0;
  Offset cone_capacity = 0;
  Offset row_capacity = 0;
  WarmStartSlot* slot = nullptr;      ///<                                                    (env_capacity)
  WarmStartRecord* record = nullptr;  ///<                                                    (env_capacity)
  WarmStartEntry* stored = nullptr;   ///< each environment's cones of the last step, sorted  (cone_capacity)
  WarmStartEntry* sorting = nullptr;  ///< scratch: cones of this step, sorted                (cone_capacity)
  Real* lambda = nullptr;             ///< reactions of the last step, in its row order       (row_capacity)
};

/// One load, as plain data.
template <class Real>
struct WarmStartLoadJob {
  WarmStartMemory<Real> memory;
  BatchLayout batch;
  const std::uint64_t* cone_id;
  Real* guess;
  double dt;
  double beta;
  StepScaling scaling;
};

/// One store, as plain data.
template <class Real>
struct WarmStartStoreJob {
  WarmStartMemory<Real> memory;
  BatchLayout batch;
  const std::uint64_t* cone_id;
  const Real* lambda;
  const EnvStatus* status;
  double dt;
};

/// One reset, as plain data.
template <class Real>
struct WarmStartResetJob {
  WarmStartMemory<Real> memory;
  const std::uint8_t* mask;  ///< not zero: reset; null: reset all  (env_capacity)
};

}  // namespace stiction
