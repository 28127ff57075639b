#include <cstring>

#include "core/facade/host_structure.hpp"
#include "core/job/row_numbers.hpp"
#include "core/machine/contact_machine.hpp"
#include "core/runtime/check/defects.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace {

void require_structure(const std::vector<Defect>& defects) {
  if (defects.empty()) return;
  throw Error(ErrorCode::invalid_argument, "the batch cannot be copied: " + defects.front().message);
}

/// What is in use of a host batch, one environment behind the other.
template <class Real>
ContactBatch<Real> packed(const ContactBatchView<Real>& batch) {
  typename ContactBatch<Real>::Arrays to;
  to.env_row_offsets = to.env_cone_offsets = to.cone_row_offsets = to.row_offsets = {0};
  if (batch.factor_offsets != nullptr) to.factor_offsets = {0};
  const auto append = [](auto& target, const auto* source, Offset count) {
    if (count > 0) target.insert(target.end(), source, source + count);
  };
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset cone = batch.env_cone_offsets[env], row = batch.env_row_offsets[env];
    const Index cones = batch.env_cones(env), rows = batch.env_rows(env);
    const Offset shift = to.env_row_offsets.back() - row;
    append(to.cone_kind, batch.cone_kind + cone, cones);
    if (batch.cone_group != nullptr) append(to.cone_group, batch.cone_group + cone, cones);
    for (Index c = 1; c <= cones; ++c) to.cone_row_offsets.push_back(batch.cone_row_offsets[cone + c] + shift);
    for (Offset r = row; r < row + rows; ++r) {
      const Index entries = batch.row_entries(r);
      append(to.column, batch.row_columns(r), entries);
      append(to.A, batch.A + batch.row_offsets[r], entries);
      to.row_offsets.push_back(static_cast<Offset>(to.A.size()));
    }
    append(to.b, batch.b + row, rows);
    append(to.R, batch.R + row, rows);
    for (Offset r = row; r < row + rows; ++r) to.mu.push_back(batch.mu[batch.mu_at(r)]);
    append(to.lo, batch.lo + row, rows);
    append(to.hi, batch.hi + row, rows);
    if (batch.factor_offsets != nullptr) {
      const Offset first = batch.factor_offsets[env];
      append(to.factor, batch.factor + first, batch.factor_offsets[env + 1] - first);
      to.factor_offsets.push_back(static_cast<Offset>(to.factor.size()));
    }
    to.env_row_offsets.push_back(static_cast<Offset>(to.b.size()));
    to.env_cone_offsets.push_back(static_cast<Offset>(to.cone_kind.size()));
  }
  if (batch.env_flags != nullptr) append(to.env_flags, batch.env_flags, batch.env_count);
  if (batch.env_tolerance != nullptr) append(to.env_tolerance, batch.env_tolerance, batch.env_count);
  if (batch.env_max_iterations != nullptr) append(to.env_max_iterations, batch.env_max_iterations, batch.env_count);
  return ContactBatch<Real>::from_arrays(batch.law, std::move(to));
}

/// The numbers of a device batch beside its structure.
template <class Real>
struct HostNumbers {
  std::vector<Real> A, vectors[5];
  std::vector<std::uint32_t> flags;
  std::vector<double> tolerance;
  std::vector<Index> max_iterations;
};

}  // namespace

void Solver::copy_to_host(void* target, const void* source, std::size_t bytes, MemorySpace space,
                          StreamRef stream) const {
  if (bytes == 0) return;
  if (space == MemorySpace::host)
    std::memcpy(target, source, bytes);
  else
    machine_->copy_to_host(target, source, bytes, stream);
}

template <class Real>
ContactBatch<Real> Solver::to_host(const ContactBatchView<Real>& batch, StreamRef stream) const {
  if (batch.normal_last)
    throw Error(ErrorCode::unsupported,
                "batch.normal_last is set, which no ContactBatch can say: put the normal first");
  if (batch.space == MemorySpace::host) {
    require_structure(validate_structure(batch, 1));
    return packed(batch);
  }
  if (batch.factor_offsets != nullptr || batch.mu_offsets != nullptr)
    throw Error(ErrorCode::unsupported,
                "the batch has factor_offsets or mu_offsets in device memory, which are not copied: assemble it with "
                "FactorUse::never and give mu by rows");
  const HostStructure<Real> structure(batch, *machine_, stream);
  require_structure(validate_structure(structure.view(), 1));
  ContactBatchView<Real> host = structure.view();
  HostNumbers<Real> numbers;
  const auto fetch = [&](auto& storage, const auto* source, Offset count) {
    storage.resize(static_cast<std::size_t>(count));
    to_host(std::span(storage), source, batch.space, stream);
    return storage.data();
  };
  host.A = fetch(numbers.A, batch.A, batch.nonzero_count);
  std::vector<Real>* storage = numbers.vectors;
  for (const auto member : kRowNumbers<Real>) host.*member = fetch(*storage++, batch.*member, batch.row_count);
  if (batch.env_flags != nullptr) host.env_flags = fetch(numbers.flags, batch.env_flags, batch.env_count);
  if (batch.env_tolerance != nullptr)
    host.env_tolerance = fetch(numbers.tolerance, batch.env_tolerance, batch.env_count);
  if (batch.env_max_iterations != nullptr)
    host.env_max_iterations = fetch(numbers.max_iterations, batch.env_max_iterations, batch.env_count);
  return packed(host);
}

template ContactBatch<float> Solver::to_host(const ContactBatchView<float>&, StreamRef) const;
template ContactBatch<double> Solver::to_host(const ContactBatchView<double>&, StreamRef) const;

}  // namespace stiction
