#include "distributed/program/column.hpp"

#include <fmt/format.h>

#include "cli/load.hpp"
#include "stiction/error.hpp"

namespace stiction::distributed {

namespace {

constexpr Index kHeight = 15;  ///< of the box, in its widths
constexpr int kDefaultSize = 4, kLargestSize = 64;
constexpr double kCompliance = 1e-5;  ///< [m/(N s)]

}  // namespace

ColumnScene column_scene(const SolveArguments& arguments) {
  const int size = arguments.size > 0 ? arguments.size : kDefaultSize;
  if (size > kLargestSize)
    throw Error(ErrorCode::invalid_argument, fmt::format("--size {}: scene {} takes 1 to {}, which is its width in "
                                                         "cells of four spheres",
                                                         size, kColumn, kLargestSize));
  ColumnScene scene;
  scene.side = size;
  scene.layers = kHeight * size;
  scene.stepping.cfm = kCompliance;
  scene.law = cli::law_from_option(arguments.law).value_or(Law::coulomb);
  return scene;
}

std::uint64_t column_seed(const SolveArguments& arguments, std::int64_t env) {
  return arguments.seed + static_cast<std::uint64_t>(env);
}

}  // namespace stiction::distributed
