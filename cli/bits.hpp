#pragma once

#include <string>

#include "stiction/types.hpp"

namespace stiction::cli {

/// As the hash sees it: every NaN is alike, +0 and -0 differ.
bool same_bits(double a, double b);

/// Distance of two values of that precision in representable numbers of `precision`: "3 ulps", or their kinds ("NaN
/// against a number"). +0 and -0 are one apart, which sets them off in an ordered count.
std::string ulps_text(double a, double b, Precision precision);

}  // namespace stiction::cli
