#pragma once

#include <string>

#include "stiction/types.hpp"

namespace stiction::cli {

/// As the hash sees it: every NaN is alike, +0 and -0 differ.
bool same_bits(double a, double b);

/// How many representable numbers of `precision` two values of that precision are apart: "3 ulps", or what else they
/// are ("NaN against a number"). +0 and -0 are one apart, which is what sets them off in an ordered count.
std::string ulps_text(double a, double b, Precision precision);

}  // namespace stiction::cli
