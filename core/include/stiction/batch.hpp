#pragma once

/// \file
/// Contact batches: A, b and cones of many environments (docs/reference/data_layout.md).

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stiction/batch_structure.hpp"
#include "stiction/types.hpp"

namespace stiction {

/// Many environments' contact systems, as solvers read them. A POD over host or device memory that owns
/// nothing. For each environment, with n rows tiled by cones, find lambda in the cones and
///
///     w = (A + diag R) lambda + b,   w complementary to lambda by the cones' law.
///
/// Rows of all environments follow one another; columns of A count from the environment's own first row.
///
/// Arrays of fixed room per environment (padded arrays) are read in place. The offsets then give where the room of an
/// environment, or of a row of A, begins. The counts give how much of it is in use, from its beginning. The rest is
/// not read, and of a solution not written. The entry of cone_row_offsets behind an environment's last cone closes
/// that cone. Room for cones hence needs one more than there are cones where it is not the last in use (PaddedLayout
/// in padded.hpp arranges all this).
template <class Real>
struct ContactBatchView : BatchStructure, RowLimits<Real> {
  const Real* A = nullptr;       ///< Delassus operator, without R; duplicates add up [w / lambda]  (nonzero_count)
  const Real* factor = nullptr;  ///< Y, row-major, rows x dofs                                   (factor_count)
  const Real* b = nullptr;       ///< right-hand side [w]                                         (row_count)
};

/// One environment to be appended to a ContactBatch: the same arrays, counted from this environment's zero.
template <class Real>
struct Environment {
  /// One cone; its rows follow those of the cone before it.
  struct Cone {
    ConeKind kind = ConeKind::unilateral;  ///< kind
    Index row_count = 1;                   ///< rows: 1, of a friction cone, boxed or not, 2 to 6
    Index group = -1;                      ///< manifold id, -1: a separate vertex
  };
  std::vector<Cone> cones;            ///< cones, in the order of their rows
  std::vector<Index> row_offsets{0};  ///< CSR rows of A        (n + 1)
  std::vector<Index> column;          ///< CSR columns          (nnz)
  std::vector<Real> A;                ///< CSR values           (nnz)
  std::vector<Real> b;                ///< right-hand side [w]  (n)
  std::vector<Real> R, mu, lo, hi;    ///< compliance, friction, bounds; empty means zeros  (n)

  /// Fills A from a dense row-major n x n matrix; entries that are exactly zero are not stored.
  void set_dense(std::span<const Real> matrix, Index n);
};

/// Owner of a batch on the host; append-only.
template <class Real>
class ContactBatch {
 public:
  /// An empty batch of the convex law.
  ContactBatch() = default;
  /// An empty batch of that law.
  explicit ContactBatch(Law law) : law_(law) {}

  /// The batch as flat arrays, moved in at once (shapes as in ContactBatchView; empty groups, flags, limits or
  /// factor_offsets mean none).
  struct Arrays {
    std::vector<Offset> env_row_offsets, env_cone_offsets;  ///< first row and cone of each environment  (env_count + 1)
    std::vector<ConeKind> cone_kind;                        ///< kind of each cone                       (cone_count)
    std::vector<Offset> cone_row_offsets;   ///< first row of each cone                  (cone_count + 1)
    std::vector<Index> cone_group;          ///< manifold of each cone, or empty         (cone_count)
    std::vector<Offset> row_offsets;        ///< CSR rows of A                           (row_count + 1)
    std::vector<Index> column;              ///< CSR columns                             (nonzero_count)
    std::vector<Real> A;                    ///< CSR values [w / lambda]                 (nonzero_count)
    std::vector<Real> b, R, mu, lo, hi;     ///< numbers of the rows                     (row_count)
    std::vector<std::uint32_t> env_flags;   ///< EnvFlag bits, or empty                  (env_count)
    std::vector<double> env_tolerance;      ///< tolerance of each, or empty [-]         (env_count)
    std::vector<Index> env_max_iterations;  ///< iterations of each, or empty            (env_count)
    std::vector<Offset> factor_offsets;     ///< first entry of each Y, or empty         (env_count + 1)
    std::vector<Real> factor;               ///< Y of all environments
  };

  /// Takes arrays over. \throws Error(invalid_argument) naming the first array whose shape is wrong, with the expected
  /// and the given one; values are the business of validate().
  static ContactBatch from_arrays(Law law, Arrays arrays);

  /// Appends one environment (possibly empty). \throws Error(invalid_argument) on a wrong shape; then nothing
  /// was appended.
  void add(const Environment<Real>& environment);

  /// The batch as solvers read it, in host memory; valid while the batch lives and is not appended to.
  [[nodiscard]] ContactBatchView<Real> view() const noexcept;
  /// Environments so far.
  [[nodiscard]] Offset env_count() const noexcept { return static_cast<Offset>(arrays_.env_row_offsets.size()) - 1; }
  /// Rows of all environments.
  [[nodiscard]] Offset row_count() const noexcept { return arrays_.env_row_offsets.back(); }
  /// The arrays themselves.
  [[nodiscard]] const Arrays& arrays() const noexcept { return arrays_; }
  /// Law of the friction cones.
  [[nodiscard]] Law law() const noexcept { return law_; }
  /// Changes the law of the friction cones; the numbers stay.
  void set_law(Law law) noexcept { law_ = law; }

 private:
  Arrays arrays_{{0}, {0}, {}, {0}, {}, {0}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}};
  Law law_ = Law::convex;
};

/// Converts a batch. Every number is rounded to To (to nearest; overflows become infinite and are then flagged by the
/// solver, in that environment alone).
template <class To, class From>
ContactBatch<To> convert(const ContactBatch<From>& batch);

/// The environments of `order` (indices into `batch`, repeats allowed), in that order.
template <class Real>
ContactBatch<Real> gather(const ContactBatch<Real>& batch, std::span<const Offset> order);

/// One broken precondition, and where.
struct Defect {
  Offset env = -1;          ///< environment, -1: the batch as a whole
  Index cone = -1;          ///< cone within the environment, -1: none
  Index row = -1;           ///< row within the environment, -1: none
  bool structural = false;  ///< offsets, columns, cone tiling: no solver can be run at all
  std::string message;      ///< one sentence: what, where, the value, what to do
};

/// Every broken precondition of a host batch, at most `limit` of them, in the order of the arrays. Structure first:
/// values are read only where the structure holds. An empty result means that the batch is sound. Complementary
/// pivoting (`lemke`, and `automatic`, which has it) also takes rows of A + R without a positive diagonal, in
/// environments without friction cones. Under those solvers they are no defects. Nor are rows of A + R that are zero as
/// a whole (kFlagImmovable).
template <class Real>
std::vector<Defect> validate(const ContactBatchView<Real>& batch, std::size_t limit = 64,
                             SolverKind solver = SolverKind::npgs);

/// max |A - A'| / max |A| of each environment (0 when symmetric or empty).  (env_count)
template <class Real>
std::vector<double> asymmetry(const ContactBatchView<Real>& batch);

}  // namespace stiction
