#pragma once

#include <cstdint>
#include <utility>

#include "core/team/team.hpp"
#include "cuda/emulated/emulated_pace.hpp"

namespace stiction::test {

/// Any Team whose lanes disagree about speed. Before and after each phase a lane goes on at once, yields or sleeps, as
/// its own pseudo-random sequence says.
template <Team Inner>
class JitterTeam {
 public:
  static constexpr Index kRowTile = Inner::kRowTile;

  JitterTeam(Inner inner, std::uint64_t seed)
      : inner_(std::move(inner)), pace_(seed, static_cast<std::uint64_t>(inner_.rank())) {}

  [[nodiscard]] Index rank() const { return inner_.rank(); }
  [[nodiscard]] Index size() const { return inner_.size(); }
  void sync() {
    pace_.step();
    inner_.sync();
    pace_.step();
  }
  template <class F>
  auto broadcast(F&& f) {
    pace_.step();
    const auto value = inner_.broadcast(std::forward<F>(f));
    pace_.step();
    return value;
  }
  std::uint32_t combine(std::uint32_t bits) {
    pace_.step();
    return inner_.combine(bits);
  }
  template <class T>
  T max(T value) {
    pace_.step();
    return inner_.max(value);
  }
  template <class T>
  T* leaves() {
    return inner_.template leaves<T>();
  }

 private:
  Inner inner_;
  cuda::Pace pace_;
};

}  // namespace stiction::test
