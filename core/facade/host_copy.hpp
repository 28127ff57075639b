#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <vector>

#include "core/machine/contact_machine.hpp"
#include "stiction/batch_arrays.hpp"

namespace stiction {

/// Host copy of a device batch: its integers, which a plan is made from, and its numbers where they are asked for.
template <class Real>
class HostCopy {
 public:
  HostCopy(const ContactBatchView<Real>& batch, bool with_numbers, ContactMachine& machine, StreamRef stream)
      : view_(batch) {
    for_each_array(
        batch,
        [&]<class T>(const BatchArray& what, const T*& array) {
          if (array == nullptr) return;
          if (std::is_floating_point_v<T> && !with_numbers) {
            array = nullptr;
            return;
          }
          const std::size_t bytes = static_cast<std::size_t>(what.length) * sizeof(T);
          memory_.push_back(std::make_unique<std::byte[]>(bytes));
          if (bytes > 0) machine.copy_to_host(memory_.back().get(), array, bytes, stream);
          array = reinterpret_cast<const T*>(memory_.back().get());
        },
        view_);
    view_.space = MemorySpace::host;
  }

  [[nodiscard]] const ContactBatchView<Real>& view() const noexcept { return view_; }

 private:
  ContactBatchView<Real> view_;
  std::vector<std::unique_ptr<std::byte[]>> memory_;
};

}  // namespace stiction
