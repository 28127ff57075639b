#pragma once

#include <vector>

#include "core/machine/contact_machine.hpp"

namespace stiction {

/// Host copy of a device batch's structure (offsets, counts, kinds, columns, groups; no numbers), for planning.
template <class Real>
class HostStructure {
 public:
  HostStructure(const ContactBatchView<Real>& batch, ContactMachine& machine, StreamRef stream) : view_(batch) {
    const auto fetch = [&](const auto*& pointer, auto& storage, Offset count) {
      storage.resize(static_cast<std::size_t>(count));
      if (count > 0 && pointer != nullptr)
        machine.copy_to_host(storage.data(), pointer, storage.size() * sizeof(storage[0]), stream);
      if (pointer != nullptr) pointer = storage.data();
    };
    fetch(view_.env_row_offsets, env_row_offsets_, batch.env_count + 1);
    fetch(view_.env_cone_offsets, env_cone_offsets_, batch.env_count + 1);
    fetch(view_.env_row_counts, env_row_counts_, batch.env_count);
    fetch(view_.env_cone_counts, env_cone_counts_, batch.env_count);
    fetch(view_.cone_kind, cone_kind_, batch.cone_count);
    fetch(view_.cone_row_offsets, cone_row_offsets_, batch.cone_count + 1);
    fetch(view_.cone_group, cone_group_, batch.cone_count);
    fetch(view_.row_offsets, row_offsets_, batch.row_count + 1);
    fetch(view_.row_counts, row_counts_, batch.row_count);
    fetch(view_.column_offsets, column_offsets_, batch.row_count);
    fetch(view_.column, column_, batch.columns_stored());
    view_.env_flags = nullptr;
    view_.env_tolerance = nullptr;
    view_.env_max_iterations = nullptr;
    view_.A = view_.b = view_.R = view_.mu = view_.lo = view_.hi = nullptr;
    view_.space = MemorySpace::host;
  }

  [[nodiscard]] const ContactBatchView<Real>& view() const noexcept { return view_; }

 private:
  ContactBatchView<Real> view_;
  std::vector<Offset> env_row_offsets_, env_cone_offsets_, cone_row_offsets_, row_offsets_, column_offsets_;
  std::vector<ConeKind> cone_kind_;
  std::vector<Index> cone_group_, env_row_counts_, env_cone_counts_, row_counts_, column_;
};

}  // namespace stiction
