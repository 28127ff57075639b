#include "c_api/judge.hpp"

#include <span>

#include "c_api/structs.hpp"
#include "c_api/views.hpp"
#include "stiction/hash.hpp"
#include "stiction/residual.hpp"

namespace stiction::c {

void need_host(MemorySpace space) {
  if (space != MemorySpace::host) refuse("batch.space is cuda: this call reads batches in host memory");
}

template <class Real>
void need_valid(const ContactBatchView<Real>& batch, SolverKind solver) {
  const std::vector<Defect> defects = validate(batch, 1, solver);
  if (!defects.empty()) refuse(defects.front().message);
}

template <class Real>
void need_sound(const ContactBatchView<Real>& batch) {
  const std::vector<Defect> defects = validate(batch, 1);
  if (!defects.empty() && defects.front().structural) refuse(defects.front().message);
}

namespace {

/// Judges a host batch; `told` makes one element of `found` of the residual of an environment.
template <class Element, class Told>
void judge(const stiction_batch_view* batch, const void* lambda, Element* found, const char* name, const char* remedy,
           const Told& told) {
  const stiction_batch_view given = read_struct(batch, "batch");
  with_real(precision_of("batch.precision", given.precision), [&](auto zero) {
    using Real = decltype(zero);
    const auto view = to_cpp<Real>(given);
    need_host(view.space);
    need_sound(view);
    if (view.row_count > 0) need(lambda, "lambda", "give one number per row of the batch");
    if (view.env_count > 0) need(found, name, remedy);
    const auto rows = static_cast<std::size_t>(view.row_count);
    const auto judged = verify(view, std::span(numbers<Real>(lambda), rows));
    for (std::size_t env = 0; env < judged.size(); ++env) found[env] = told(judged[env]);
  });
}

}  // namespace

template void need_valid(const ContactBatchView<float>&, SolverKind);
template void need_valid(const ContactBatchView<double>&, SolverKind);
template void need_sound(const ContactBatchView<float>&);
template void need_sound(const ContactBatchView<double>&);

}  // namespace stiction::c

namespace c = stiction::c;

stiction_code stiction_validate(const stiction_batch_view* batch, int32_t solver) {
  return c::guarded([&] {
    const stiction_batch_view given = c::read_struct(batch, "batch");
    const auto kind = c::solver_of("solver", solver);
    c::with_real(c::precision_of("batch.precision", given.precision), [&](auto zero) {
      const auto view = c::to_cpp<decltype(zero)>(given);
      c::need_host(view.space);
      c::need_valid(view, kind);
    });
  });
}

stiction_code stiction_verify(const stiction_batch_view* batch, const void* lambda, stiction_residual* residual) {
  return c::guarded([&] {
    c::judge(batch, lambda, residual, "residual", "give it room for one stiction_residual per environment",
             [](const stiction::Residual& judged) { return stiction_residual{judged.relative, judged.absolute}; });
  });
}

stiction_code stiction_worst_contacts(const stiction_batch_view* batch, const void* lambda,
                                      stiction_worst_contact* worst) {
  return c::guarded([&] {
    c::judge(batch, lambda, worst, "worst", "give it room for one stiction_worst_contact per environment",
             [](const stiction::Residual& judged) {
               return stiction_worst_contact{stiction::worst_error(judged), judged.scale, judged.cone, 0};
             });
  });
}

stiction_code stiction_hash(int32_t precision, const void* values, int64_t count, uint64_t* hash) {
  return c::guarded([&] {
    const auto type = c::precision_of("precision", precision);
    if (count < 0) c::refuse("count = " + std::to_string(count) + ": give a number of elements >= 0");
    if (count > 0) c::need(values, "values", "give the array to be hashed");
    c::need(hash, "hash", "give it room for one number");
    c::with_real(type, [&](auto zero) {
      using Real = decltype(zero);
      *hash = stiction::hash_bits(std::span(c::numbers<Real>(values), static_cast<std::size_t>(count)));
    });
  });
}
