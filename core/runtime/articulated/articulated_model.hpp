#pragma once

#include <vector>

#include "core/job/articulated_job.hpp"

namespace stiction {

/// Throws for a description that is out of range or beyond the models stepped in lanes.
void check_articulated(const ArticulatedDescription& description);

/// A description as kernels read it: constants, and the order of everything. The model has the data for any number of
/// a constant that varies.
template <class T>
class ArticulatedModel {
 public:
  /// The description was checked. \throws Error(unsupported) if more rows could be active than there is room for.
  ArticulatedModel(const ArticulatedDescription& description, VariedSet varies);
  [[nodiscard]] ArticulatedModelView<T> view() const;
  /// Coordinates in which the description has its bodies.
  [[nodiscard]] const std::vector<T>& qpos0() const { return qpos0_; }

 private:
  void add_bodies(const ArticulatedDescription& from);
  void add_actuators(const ArticulatedDescription& from);
  void add_pairs(const ArticulatedDescription& from);
  void add_limits(const ArticulatedDescription& from);
  void add_groups(const ArticulatedDescription& from);
  void put_columns(RowClass& rows, const std::vector<int>& side);
  /// Degrees of freedom that move a body.
  [[nodiscard]] std::vector<Index> chain_of(Index body) const;

  [[nodiscard]] bool varies(VariedArray one) const { return (varies_ & bit_of(one)) != 0; }

  ArticulatedModelView<T> view_{};
  VariedSet varies_;  ///< constants of which environments have their own
  std::vector<ArticulatedBodyData<T>> bodies_;
  std::vector<ArticulatedJointData<T>> joints_;
  std::vector<ArticulatedDofData<T>> dofs_;
  std::vector<ArticulatedActuatorData<T>> actuators_;
  std::vector<ArticulatedGeomData<T>> geoms_;
  std::vector<ArticulatedFieldData<T>> fields_;
  std::vector<T> heights_;  ///< of all fields
  std::vector<ArticulatedVertexData<T>> vertices_;
  std::vector<ArticulatedFaceData<T>> faces_;
  std::vector<Index> corners_;
  std::vector<ArticulatedPairData<T>> pairs_;
  std::vector<ArticulatedEqualityData<T>> equalities_;
  std::vector<ArticulatedLimitData<T>> limits_;
  std::vector<ArticulatedLossData<T>> losses_;
  std::vector<ArticulatedTendonTermData<T>> tendon_terms_;
  std::vector<RowGroup> groups_;
  std::vector<RowClass> classes_;
  std::vector<Index> columns_;
  std::vector<std::int8_t> sides_;
  std::vector<T> qpos0_;
};

}  // namespace stiction
