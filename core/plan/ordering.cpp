#include "core/plan/ordering.hpp"

#include <numeric>

#include "core/plan/block_tables.hpp"
#include "core/plan/ordering_algorithms.hpp"

namespace stiction {

const char* to_string(Ordering ordering) noexcept {
  switch (ordering) {
    case Ordering::natural:
      return "natural";
    case Ordering::reverse_cuthill_mckee:
      return "reverse_cuthill_mckee";
    case Ordering::minimum_degree:
      return "minimum_degree";
    case Ordering::suitesparse_minimum_degree:
      return "suitesparse_minimum_degree";
    case Ordering::nested_dissection:
      return "nested_dissection";
  }
  return "unknown";
}

bool is_available(Ordering ordering) noexcept {
  switch (ordering) {
    case Ordering::natural:
    case Ordering::reverse_cuthill_mckee:
      return true;
    case Ordering::minimum_degree:
      return kHasEigenOrdering;
    case Ordering::suitesparse_minimum_degree:
      return kHasSuiteSparseOrdering;
    case Ordering::nested_dissection:
      return kHasMetisOrdering;
  }
  return false;
}

std::vector<Index> order_rows(const BlockPattern& pattern, Ordering ordering) {
  expect_diagonal(pattern);
  switch (ordering) {
    case Ordering::natural:
      break;
    case Ordering::reverse_cuthill_mckee:
      return order_cuthill_mckee(pattern);
    case Ordering::minimum_degree:
      return order_eigen(pattern);
    case Ordering::suitesparse_minimum_degree:
      return order_suitesparse(pattern);
    case Ordering::nested_dissection:
      return order_metis(pattern);
  }
  std::vector<Index> order(static_cast<std::size_t>(pattern.rows));
  std::iota(order.begin(), order.end(), 0);
  return order;
}

}  // namespace stiction
