#pragma once

#include <cstring>
#include <vector>

#include "core/job/row_numbers.hpp"
#include "cuda/api/memory.hpp"
#include "stiction/solver.hpp"
#include "tests/support/systems/scene_batches.hpp"

namespace stiction::test {

/// A batch and its answer in a device's memory, with room to be filled again and again.
template <class Real>
class DeviceBatch {
 public:
  DeviceBatch(cuda::DeviceApi& api, const Capacity& room) : api_(api), room_(room) {
    view_.env_count = room.envs;
    view_.cone_count = room.cones;
    view_.row_count = room.rows;
    view_.nonzero_count = room.nonzeros;
    view_.space = MemorySpace::cuda;
    add(view_.env_row_offsets, room.envs + 1);
    add(view_.env_cone_offsets, room.envs + 1);
    add(view_.cone_kind, room.cones);
    add(view_.cone_row_offsets, room.cones + 1);
    add(view_.cone_group, room.cones);
    add(view_.row_offsets, room.rows + 1);
    add(view_.column, room.nonzeros);
    add(view_.A, room.nonzeros);
    for (const auto member : kRowNumbers<Real>) add(view_.*member, room.rows);
    arrays_.add(solution_.lambda, room.rows);
    arrays_.add(solution_.w, room.rows);
    arrays_.add(solution_.status, room.envs);
    memory_ = cuda::DeviceMemory(api, arrays_.bytes());
    arrays_.place(memory_.get());
  }

  /// Puts a host batch of as many environments there, in the order of `stream`; `batch` must last until it is done.
  void fill(const ContactBatch<Real>& batch, cuda::StreamHandle stream) {
    const ContactBatchView<Real> host = batch.view();
    const auto put = [&](const auto* target, const auto* source, Offset count) {
      if (source != nullptr && count > 0)
        api_.copy(const_cast<void*>(static_cast<const void*>(target)), source,
                  static_cast<std::size_t>(count) * sizeof(*source), cuda::CopyKind::to_device, stream);
    };
    put(view_.env_row_offsets, host.env_row_offsets, host.env_count + 1);
    put(view_.env_cone_offsets, host.env_cone_offsets, host.env_count + 1);
    put(view_.cone_kind, host.cone_kind, host.cone_count);
    put(view_.cone_row_offsets, host.cone_row_offsets, host.cone_count + 1);
    no_groups_.assign(static_cast<std::size_t>(room_.cones), -1);
    put(view_.cone_group, host.cone_group != nullptr ? host.cone_group : no_groups_.data(), host.cone_count);
    put(view_.row_offsets, host.row_offsets, host.row_count + 1);
    put(view_.column, host.column, host.nonzero_count);
    put(view_.A, host.A, host.nonzero_count);
    for (const auto member : kRowNumbers<Real>) put(view_.*member, host.*member, host.row_count);
    view_.law = host.law;
  }

  /// The answer, once `stream` has come this far.
  Solution<Real> fetch(const ContactBatch<Real>& batch, cuda::StreamHandle stream) {
    const auto rows = static_cast<std::size_t>(batch.row_count());
    Solution<Real> answer{std::vector<Real>(rows), std::vector<Real>(rows),
                          std::vector<EnvStatus>(static_cast<std::size_t>(room_.envs))};
    const auto get = [&](auto& target, const auto* source) {
      if (!target.empty())
        api_.copy(target.data(), source, target.size() * sizeof(target[0]), cuda::CopyKind::to_host, stream);
    };
    get(answer.lambda, solution_.lambda);
    get(answer.w, solution_.w);
    get(answer.status, solution_.status);
    api_.synchronize(stream);
    return answer;
  }

  [[nodiscard]] const ContactBatchView<Real>& view() const { return view_; }
  [[nodiscard]] const SolutionView<Real>& solution() const { return solution_; }

 private:
  template <class T>
  void add(const T*& target, Offset count) {
    arrays_.add(target, count);
  }

  cuda::DeviceApi& api_;
  Capacity room_;
  cuda::ArraySet arrays_;
  cuda::DeviceMemory memory_;
  ContactBatchView<Real> view_;
  SolutionView<Real> solution_;
  std::vector<Index> no_groups_;
};

/// The larger of two capacities, member by member.
inline Capacity larger(const Capacity& a, const Capacity& b) {
  return {std::max(a.envs, b.envs),         std::max(a.rows, b.rows),          std::max(a.cones, b.cones),
          std::max(a.nonzeros, b.nonzeros), std::max(a.env_rows, b.env_rows),  std::max(a.env_nonzeros, b.env_nonzeros),
          std::max(a.env_dofs, b.env_dofs), std::max(a.precision, b.precision)};
}

}  // namespace stiction::test
