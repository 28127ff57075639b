#pragma once

#include <variant>

#include "c_api/errors.hpp"
#include "stiction/status.hpp"
#include "stiction/types.hpp"

namespace stiction::c {

/// Calls f with the solver of that precision. `any` holds one that was made for float or for double: the first or the
/// second alternative. \throws Error(invalid_argument) if it is not the batch's.
template <class Any, class F>
void with_typed(Any& any, Precision batch, F&& f) {
  const auto made_for = static_cast<Precision>(any.index());
  if (made_for != batch)
    refuse(std::string("batch.precision is ") + to_string(batch) + ", but the solver was made for " +
           to_string(made_for) + ": make another with that in capacity.precision");
  std::visit(std::forward<F>(f), any);
}

}  // namespace stiction::c
