#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/support/golden/bodies.hpp"
#include "tests/support/golden/case.hpp"
#include "tests/support/golden/derivatives.hpp"
#include "tests/support/golden/forms.hpp"
#include "tests/support/golden/matrices.hpp"
#include "tests/support/golden/robots.hpp"

/// The golden hashes: the answers of every build, compiler and machine within one numerics epoch.
namespace stiction::test {

/// A row of the table: name as GoldenCase has it.
struct Golden {
  const char* name;
  std::uint64_t hash;
};

inline constexpr Golden kGoldens[] = {
#include "tests/support/golden/hashes.inc"
};

/// The hash of each row by its name.
inline const std::map<std::string, std::uint64_t>& goldens() {
  static const auto table = [] {
    std::map<std::string, std::uint64_t> result;
    for (const Golden& golden : kGoldens) result.emplace(golden.name, golden.hash);
    return result;
  }();
  return table;
}

/// First parts of the names. Derivatives are not asked of a GPU: they read the arrays where they are.
inline constexpr const char* kGoldenDerivatives = "derivative";
inline constexpr const char* kGoldenForms[] = {"matrix", "pyramid", "jacobian", "factor", "bodies", "worlds", "robots"};

/// Every row, to be computed; the order is that of hashes.inc.
inline const GoldenCases& golden_cases() {
  static const auto all = [] {
    GoldenCases cases;
    add_matrix_goldens(cases);
    add_option_goldens(cases);
    add_pyramid_goldens(cases);
    add_box_friction_goldens(cases);
    add_semidefinite_goldens(cases);
    add_jacobian_goldens(cases);
    add_factor_goldens(cases);
    add_velocity_goldens(cases);
    add_large_and_factored_goldens(cases);
    add_block_goldens(cases);
    add_body_goldens(cases);
    add_world_goldens(cases);
    add_contact_derivatives(cases);
    add_jacobian_derivatives(cases);
    add_sweep_derivatives(cases);
    add_robot_goldens(cases);
    return cases;
  }();
  return all;
}

/// Returns the table's cases of one form.
inline GoldenCases golden_cases_of(const std::string& form) {
  GoldenCases cases;
  for (const GoldenCase& row : golden_cases())
    if (row.name.rfind(form + "/", 0) == 0 && goldens().count(row.name) == 1) cases.push_back(row);
  return cases;
}

}  // namespace stiction::test
