#pragma once

#include <array>
#include <memory>
#include <mutex>

#include "core/machine/body_machine.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/kernels/bodies_args.hpp"

namespace stiction::cuda {

/// Bodies on a device. The first solve with a plan (or with another precision, law or momentum) copies its integers
/// there and makes room. Later ones are launches and nothing else, so they can be captured. A batch in host memory is
/// copied there and back.
class DeviceBodyMachine final : public BodyMachine {
 public:
  /// `eager`: solves are complete on return, for a device that does nothing before it is waited for.
  DeviceBodyMachine(std::shared_ptr<DeviceApi> api, bool eager);

  void solve(const BodyRequest<float>& request) override;
  void solve(const BodyRequest<double>& request) override;
  void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) override;

 private:
  static constexpr int kClasses = 6;

  /// Environments that are solved by one launch.
  struct Class {
    Offset begin = 0, end = 0;  ///< in order_
    LaunchShape shape;
    Offset slot_elements = 0;  ///< of a bundle's lane; 0: teams work on the class
    Offset slot_bytes = 0;     ///< of a team
    Offset workspace_bytes = 0;
    std::byte* workspace = nullptr;
  };
  /// Sizes for which room and copies were made.
  struct Reserved {
    std::weak_ptr<const BodyPlanData> plan;
    std::size_t scalar_bytes = 0;
    Law law = Law::convex;
    bool momentum = false;
    BodyMethod method = BodyMethod::impulses;
    bool operator==(const Reserved& other) const {
      return plan.lock() == other.plan.lock() && scalar_bytes == other.scalar_bytes && law == other.law &&
             momentum == other.momentum && method == other.method;
    }
  };

  template <class Real>
  void run(const BodyRequest<Real>& request);
  template <class Real>
  void run_on_device(const BodyRequest<Real>& request);
  template <class Real>
  void run_from_host(const BodyRequest<Real>& request);
  template <class Real>
  void load(const BodyRequest<Real>& request);
  template <class Real>
  void make_classes(const BodyRequest<Real>& request, std::vector<Offset>& order);

  std::shared_ptr<DeviceApi> api_;
  bool eager_;
  std::mutex mutex_;
  Reserved reserved_;
  std::array<Class, kClasses> classes_;
  BodyPlanView plan_;
  const Offset* order_ = nullptr;
  Offset* ticket_ = nullptr;  ///< (kClasses)
  DeviceMemory arrays_, workspace_;
};

}  // namespace stiction::cuda
