#pragma once

#include "stiction/batch.hpp"

namespace stiction {

/// max |A - A'| / max |A| of one environment of a batch whose structure is sound; NaN where an entry is not finite.
template <class Real>
double environment_asymmetry(const ContactBatchView<Real>& batch, Offset env);

}  // namespace stiction
