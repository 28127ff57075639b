#pragma once

#include "stiction/types.hpp"

namespace stiction {

/// Largest environment for which a method may keep a matrix of its own, unless the caller says otherwise.
inline constexpr Index kDirectRows = 1024;
/// The most that a caller may say: a matrix of 8 GiB.
inline constexpr Index kMostDirectRows = 32768;

/// What a method keeps beside the system. Vectors and matrices of double are for methods that factorise: whatever the
/// solve's precision, an elimination of hundreds of rows is done in double. Such a method takes environments one at a
/// time, never in packs or bundles. Where an environment is too large for matrices, a method that can do without has
/// further vectors instead.
struct MethodRoom {
  Index vectors = 0;                ///< of n numbers of Real
  Index wide = 0;                   ///< of n doubles
  Index matrices = 0;               ///< of n x n doubles, for environments of at most direct_rows rows
  Index instead = 0;                ///< of n doubles, for larger ones; 0: the method has no other way
  Index direct_rows = kDirectRows;  ///< no less than dense systems have rows
  Index squares = 0;                ///< of n x n numbers of Real beside a dense system: for lanes of packs, too

  /// Whether an environment of n rows gets the matrices.
  [[nodiscard]] STICTION_HD constexpr bool has_matrices(Offset n) const { return n <= direct_rows; }
  /// Doubles for an environment of n rows. Not monotone: one without matrices may need less than a smaller one.
  [[nodiscard]] STICTION_HD constexpr Offset doubles(Offset n) const {
    return wide * n + (has_matrices(n) ? matrices * n * n : instead * n);
  }
  /// The same in numbers of Real.
  template <class Real>
  [[nodiscard]] STICTION_HD constexpr Offset double_elements(Offset n) const {
    return doubles(n) * static_cast<Offset>((sizeof(double) + sizeof(Real) - 1) / sizeof(Real));
  }
  /// Numbers of Real for the squares of a dense system of n rows.
  [[nodiscard]] STICTION_HD constexpr Offset square_elements(Offset n) const { return squares * n * n; }
  /// The same room without what no loading touches.
  [[nodiscard]] STICTION_HD constexpr MethodRoom to_load() const {
    MethodRoom room = *this;
    room.squares = 0;
    return room;
  }
  /// The same room for lanes each of which has an environment: no doubles.
  [[nodiscard]] STICTION_HD constexpr MethodRoom in_bundles() const {
    MethodRoom room;
    room.vectors = vectors;
    room.squares = squares;
    return room;
  }
  /// The same with matrices for environments of up to `rows` rows.
  [[nodiscard]] STICTION_HD constexpr MethodRoom up_to(Index rows) const {
    MethodRoom room = *this;
    room.direct_rows = rows;
    return room;
  }
  /// Whether the method factorises.
  [[nodiscard]] STICTION_HD constexpr bool is_direct() const { return wide > 0 || matrices > 0; }
  /// What is enough for either of two methods.
  [[nodiscard]] STICTION_HD constexpr MethodRoom joined(const MethodRoom& other) const {
    return {vectors > other.vectors ? vectors : other.vectors,
            wide > other.wide ? wide : other.wide,
            matrices > other.matrices ? matrices : other.matrices,
            instead > other.instead ? instead : other.instead,
            direct_rows > other.direct_rows ? direct_rows : other.direct_rows,
            squares > other.squares ? squares : other.squares};
  }
  friend constexpr bool operator==(const MethodRoom&, const MethodRoom&) = default;
};

}  // namespace stiction
