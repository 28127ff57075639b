#pragma once

#include <array>
#include <cstring>
#include <span>
#include <vector>

#include "core/algorithm/rigid/newton/domain_newton.hpp"
#include "distributed/newton/domains.hpp"
#include "distributed/newton/reach.hpp"
#include "distributed/transport/letters.hpp"

namespace stiction::inline STICTION_ISA {

/// A rank as a team of one lane to the solvers of linear systems. Vectors have six numbers for each body of the
/// environment; a rank has those of the bodies that it sees. Sums are over subdomains: each is summed by its rank in
/// the order of its bodies, and then they are, in their own order. Ranks hence reach no bit.
class DomainTeam {
 public:
  static constexpr Index kRowTile = SerialTeam::kRowTile;

  DomainTeam(distributed::Transport& transport, const distributed::Domains& domains, const distributed::Reach& reach,
             std::span<const int> home)
      : transport_(&transport), domains_(&domains), reach_(&reach), home_(home) {}

  static constexpr Index rank() { return 0; }
  static constexpr Index size() { return 1; }
  void sync() const {}
  template <class F>
  auto broadcast(F&& f) const {
    return f();
  }
  std::uint32_t combine(std::uint32_t bits) const { return bits; }
  template <class T>
  T max(T value) const {
    const std::vector<T> all = distributed::gather(*transport_, value);
    T largest = all.front();
    for (const T one : all) largest = max_(one, largest);
    return largest;
  }
  template <class T>
  T* leaves() const {
    return nullptr;
  }

  [[nodiscard]] const distributed::Domains& domains() const { return *domains_; }
  [[nodiscard]] const distributed::Reach& reach() const { return *reach_; }

  /// The sum over all subdomains of add(subdomain, numbers), which adds its own to N zeros.
  template <std::size_t N, class F>
  std::array<double, N> sum(F&& add) const {
    using Numbers = std::array<double, N>;
    std::vector<Numbers> mine(static_cast<std::size_t>(domains_->count()), Numbers{});
    for (const int domain : reach_->domains) add(domain, mine[static_cast<std::size_t>(domain)]);
    const std::vector<Numbers> all = distributed::gather_all(*transport_, std::span<const Numbers>(mine));
    Numbers total{};
    for (std::size_t domain = 0; domain < mine.size(); ++domain) {
      const Numbers& part = all[static_cast<std::size_t>(home_[domain]) * mine.size() + domain];
      for (std::size_t k = 0; k < N; ++k) total[k] = total[k] + part[k];
    }
    return total;
  }

 private:
  distributed::Transport* transport_;
  const distributed::Domains* domains_;
  const distributed::Reach* reach_;
  std::span<const int> home_;
};

/// For conjugate gradients: all numbers of the bodies that are seen.
template <class F>
void for_each(DomainTeam& team, Index, F&& f) {
  for (const Index body : team.reach().seen)
    for (Index k = 0; k < kBodyBlock; ++k) f(body * kBodyBlock + k);
}

/// Returns the dot product over a subdomain's own bodies.
inline double dot_of_domain(const DomainTeam& team, int domain, const double* v, const double* w) {
  double sum = 0.0;
  for (const Index body : team.domains().bodies[static_cast<std::size_t>(domain)])
    sum = add_dot(sum, v + static_cast<Offset>(body) * kBodyBlock, w + static_cast<Offset>(body) * kBodyBlock);
  return sum;
}

inline double dot_product(DomainTeam& team, Index, const double* v, const double* w) {
  return team.sum<1>([&](int domain, std::array<double, 1>& sum) { sum[0] = dot_of_domain(team, domain, v, w); })[0];
}

static_assert(Team<DomainTeam>);

}  // namespace stiction::inline STICTION_ISA
