#pragma once

#include <iterator>

#include "core/algorithm/rigid/body_system.hpp"
#include "core/base/extents.hpp"
#include "cuda/api/device_api.hpp"
#include "cuda/kernels/body_bundles.hpp"

/// Classes of body environments on a device. It is decided by its counts alone, and reaches speed only.
namespace stiction::cuda {

/// Environments that take a lane each. Their most bodies follow from the bundles that the fast memory of a
/// multiprocessor is to hold at once. A lane waits for its own numbers, and nothing but other bundles fills that time.
struct BundleRule {
  Index most_contacts;
  Offset per_processor;
};
inline constexpr BundleRule kBundleRules[] = {{4, 4}, {16, 1}};
inline constexpr int kBundleClasses = static_cast<int>(std::size(kBundleRules));

/// Contacts from which a team of a class has enough to do, and its lanes; the last is the whole device.
struct TeamRule {
  Index least_contacts;
  int lanes;
  Offset per_processor;
};
inline constexpr TeamRule kTeamRules[] = {{0, 8, 64}, {33, 32, 32}, {513, 256, 4}, {16385, kMostLanes, 1}};

/// Bundles first, then teams.
inline constexpr int kBodyClasses = kBundleClasses + static_cast<int>(std::size(kTeamRules));

/// Memory of one environment on one lane of `kStride`.
struct BodyNeed {
  Offset elements;  ///< numbers of Real
  Offset exact;     ///< numbers of double besides
  template <class Real>
  [[nodiscard]] Offset bytes() const {
    return elements * Offset{sizeof(Real)} + exact * Offset{sizeof(double)};
  }
};

template <class Real, int kStride>
BodyNeed need_of(const BodySolverOptions& options, Offset contacts, Offset bodies) {
  const auto need = [&]<Law kLaw>() -> BodyNeed {
    using System = BodySystem<Real, kLaw, kStride>;
    return {System::elements(contacts, bodies, options.momentum), System::exact_elements(bodies)};
  };
  if (options.box_friction) return need.template operator()<kBoxFriction>();
  return options.law == Law::coulomb ? need.template operator()<Law::coulomb>()
                                     : need.template operator()<Law::convex>();
}

/// Fast memory of a bundle whose lanes need that much.
template <class Real>
std::size_t bundle_bytes(const BodyNeed& lane) {
  return sizeof(BodyBundleHead<Real>) + static_cast<std::size_t>(kWarp * lane.bytes<Real>());
}

template <class Real>
class BodyClassifier {
 public:
  BodyClassifier(const BodySolverOptions& options, const DeviceFacts& facts)
      : needs_team_(options.method == BodyMethod::newton) {
    for (int k = 0; k < kBundleClasses; ++k) {
      const BundleRule& rule = kBundleRules[k];
      const auto bytes = [&](Offset bodies) {
        return static_cast<Offset>(bundle_bytes<Real>(need_of<Real, kWarp>(options, rule.most_contacts, bodies)));
      };
      const Offset room = smaller_of(static_cast<Offset>(facts.shared_bytes) - static_cast<Offset>(kTeamBytes),
                                     static_cast<Offset>(facts.resident_shared_bytes) / rule.per_processor - kOverhead);
      // With the most contacts and the most bodies at once: lanes lie side by side, so the greatest of each counts.
      most_bodies_[k] = room < bytes(0) ? -1 : (room - bytes(0)) / (bytes(1) - bytes(0));
    }
  }

  [[nodiscard]] int class_of(Index contacts, Offset bodies) const {
    for (int k = 0; k < kBundleClasses && !needs_team_; ++k)
      if (contacts <= kBundleRules[k].most_contacts && bodies <= most_bodies_[k]) return k;
    int result = kBundleClasses;
    while (result + 1 < kBodyClasses && contacts >= kTeamRules[result + 1 - kBundleClasses].least_contacts) ++result;
    return result;
  }

 private:
  /// Part of a block's fast memory that a device keeps, at most.
  static constexpr Offset kOverhead = 2048;

  bool needs_team_;  ///< Newton's method is for teams
  Offset most_bodies_[kBundleClasses];
};

}  // namespace stiction::cuda
