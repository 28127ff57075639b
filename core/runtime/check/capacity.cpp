#include <algorithm>
#include <type_traits>

#include "core/base/extents.hpp"
#include "stiction/solver.hpp"

namespace stiction {

template <class Real>
Capacity Capacity::of(const ContactBatchView<Real>& batch) {
  Capacity need{batch.env_count,
                batch.row_count,
                batch.cone_count,
                batch.nonzero_count,
                0,
                0,
                0,
                std::is_same_v<Real, float> ? Precision::f32 : Precision::f64};
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Index rows = batch.env_rows(env);
    const Offset row = batch.env_row_offsets[env];
    need.env_rows = larger_of(need.env_rows, rows);
    need.env_nonzeros = larger_of(need.env_nonzeros, batch.row_offsets[row + rows] - batch.row_offsets[row]);
    need.env_dofs = larger_of(need.env_dofs, batch.env_dofs(env));
    const ConeKind* const kinds = batch.cone_kind + batch.env_cone_offsets[env];
    const ConeKind* const end = kinds + batch.env_cones(env);
    need.semidefinite = need.semidefinite || std::find(kinds, end, ConeKind::semidefinite) != end;
  }
  return need;
}

template Capacity Capacity::of(const ContactBatchView<float>&);
template Capacity Capacity::of(const ContactBatchView<double>&);

}  // namespace stiction
