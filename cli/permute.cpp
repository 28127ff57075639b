#include "cli/permute.hpp"

#include <numeric>
#include <utility>

namespace stiction::cli {

namespace {

/// Steele, Lea, Flood 2014; written here because the distributions of <random> differ between libraries.
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }

 private:
  std::uint64_t state_;
};

}  // namespace

std::vector<Offset> random_order(Offset count, std::uint64_t seed) {
  std::vector<Offset> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), Offset{0});
  SplitMix64 random(seed);
  // The modulo's bias (2^-40 for any batch that fits a machine) is of no consequence for an order to test with.
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.next() % i]);
  return order;
}

}  // namespace stiction::cli
