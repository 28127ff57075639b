#pragma once

#include <cstdint>

#include "stiction/config.hpp"

namespace stiction {

/// How bodies are solved (docs/bodies.md).
enum class BodyMethod : std::uint8_t {
  impulses = 0,  ///< sequential impulses (docs/math/si.md)
  newton = 1,    ///< inexact Newton's method on the bodies' velocities (docs/math/body_newton.md)
};

/// What the linear systems of Newton's method in body space are made easier by.
enum class BodyPreconditioner : std::uint8_t {
  diagonal = 0,        ///< of the matrix
  block_diagonal = 1,  ///< each body by itself
};
inline constexpr int kBodyPreconditionerCount = 2;

const char* to_string(BodyMethod method) noexcept;
const char* to_string(BodyPreconditioner preconditioner) noexcept;

/// What Newton's method in body space decides when it plans.
struct BodySpaceOptions {
  BodyPreconditioner preconditioner = BodyPreconditioner::block_diagonal;
  bool operator==(const BodySpaceOptions&) const = default;
};

}  // namespace stiction
