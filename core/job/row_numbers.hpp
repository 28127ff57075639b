#pragma once

#include <array>

#include "stiction/batch.hpp"

namespace stiction {

/// Arrays of a contact batch that have a number for each row; of mu only where mu_offsets is null.
template <class Real>
inline constexpr std::array<const Real * ContactBatchView<Real>::*, 5> kRowNumbers{
    &ContactBatchView<Real>::b, &ContactBatchView<Real>::R, &ContactBatchView<Real>::mu, &ContactBatchView<Real>::lo,
    &ContactBatchView<Real>::hi};

}  // namespace stiction
