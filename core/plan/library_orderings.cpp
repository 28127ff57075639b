#include <mutex>
#include <string>

#include "core/plan/ordering_algorithms.hpp"
#include "stiction/error.hpp"

#if STICTION_HAS_EIGEN
// A caller's Eigen may be compiled for another instruction set, in which it aligns memory otherwise: the linker must
// not take one for the other.
#define Eigen stiction_eigen
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#endif
#if STICTION_HAS_SUITESPARSE_AMD
#include <amd.h>
#endif
#if STICTION_HAS_METIS
#include <metis.h>
#endif

namespace stiction {

const bool kHasEigenOrdering = STICTION_HAS_EIGEN != 0;
const bool kHasSuiteSparseOrdering = STICTION_HAS_SUITESPARSE_AMD != 0;
const bool kHasMetisOrdering = STICTION_HAS_METIS != 0;

namespace {

#if !STICTION_HAS_EIGEN || !STICTION_HAS_SUITESPARSE_AMD || !STICTION_HAS_METIS
[[noreturn]] void refuse(const char* ordering, const char* library, const char* package) {
  throw Error(ErrorCode::unsupported, std::string("ordering ") + ordering + ": this build has no " + library +
                                          "; install it (Debian: " + package +
                                          ") and configure again, or use reverse_cuthill_mckee, which every build has");
}
#endif

#if STICTION_HAS_SUITESPARSE_AMD || STICTION_HAS_METIS
/// Patterns are checked before, so that such a library can lack memory alone.
[[noreturn]] void fail(const char* call, int code, Index rows) {
  throw Error(ErrorCode::out_of_memory, std::string(call) + " gave up with code " + std::to_string(code) + " on " +
                                            std::to_string(rows) +
                                            " rows; use reverse_cuthill_mckee, which needs the "
                                            "least memory");
}
#endif

}  // namespace

std::vector<Index> order_eigen([[maybe_unused]] const BlockPattern& pattern) {
#if STICTION_HAS_EIGEN
  std::vector<Eigen::Triplet<float, Index>> entries;
  entries.reserve(static_cast<std::size_t>(pattern.blocks()));
  for (Index row = 0; row < pattern.rows; ++row)
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k)
      entries.emplace_back(row, pattern.columns[k], 1.0F);
  Eigen::SparseMatrix<float, Eigen::ColMajor, Index> matrix(pattern.rows, pattern.rows);
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, Index> permutation;
  Eigen::AMDOrdering<Index>()(matrix, permutation);
  const auto& indices = permutation.indices();
  return {indices.data(), indices.data() + indices.size()};
#else
  refuse("minimum_degree", "Eigen", "libeigen3-dev");
#endif
}

std::vector<Index> order_suitesparse([[maybe_unused]] const BlockPattern& pattern) {
#if STICTION_HAS_SUITESPARSE_AMD
  std::vector<Index> order(static_cast<std::size_t>(pattern.rows));
  if (order.empty()) return order;
  const int code = amd_order(pattern.rows, pattern.offsets, pattern.columns, order.data(), nullptr, nullptr);
  if (code < AMD_OK) fail("amd_order", code, pattern.rows);
  return order;
#else
  refuse("suitesparse_minimum_degree", "SuiteSparse", "libsuitesparse-dev");
#endif
}

std::vector<Index> order_metis([[maybe_unused]] const BlockPattern& pattern) {
#if STICTION_HAS_METIS
  std::vector<idx_t> offsets{0};
  std::vector<idx_t> neighbours;
  for (Index row = 0; row < pattern.rows; ++row) {
    for (Index k = pattern.offsets[row]; k < pattern.offsets[row + 1]; ++k)
      if (pattern.columns[k] != row) neighbours.push_back(pattern.columns[k]);
    offsets.push_back(static_cast<idx_t>(neighbours.size()));
  }
  std::vector<idx_t> order(static_cast<std::size_t>(pattern.rows));
  std::vector<idx_t> position(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<idx_t>(k);
  if (!neighbours.empty()) {
    idx_t options[METIS_NOPTIONS];
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_SEED] = 1;
    idx_t rows = pattern.rows;
    // METIS seeds the C library's one generator and draws from it: two at once would draw each other's numbers.
    static std::mutex one_at_a_time;
    const std::lock_guard lock(one_at_a_time);
    const int code =
        METIS_NodeND(&rows, offsets.data(), neighbours.data(), nullptr, options, order.data(), position.data());
    if (code != METIS_OK) fail("METIS_NodeND", code, pattern.rows);
  }
  return {order.begin(), order.end()};
#else
  refuse("nested_dissection", "METIS", "libmetis-dev");
#endif
}

}  // namespace stiction
