#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <string>

namespace stiction::python {

/// An array of another library, imported through DLPack or the buffer protocol: never copied, never converted, alive as
/// long as this is.
class Array {
 public:
  /// \throws nanobind::type_error if the object has neither protocol.
  explicit Array(nanobind::handle object);

  [[nodiscard]] nanobind::tuple shape() const;
  [[nodiscard]] nanobind::tuple strides() const;  ///< [elements]
  [[nodiscard]] std::string dtype() const;        ///< "float64", "uint8", "bool", ...
  [[nodiscard]] std::string device() const;       ///< "cpu", "cuda:0", or the DLPack number of another kind
  [[nodiscard]] bool writable() const noexcept { return writable_; }
  [[nodiscard]] bool contiguous() const noexcept;
  [[nodiscard]] std::int64_t size() const noexcept { return static_cast<std::int64_t>(memory_.size()); }
  [[nodiscard]] const void* data() const noexcept { return memory_.data(); }

  /// \throws nanobind::type_error naming the array if its numbers are of another type.
  template <class T>
  [[nodiscard]] const T* read(const char* name) const {
    require(name, nanobind::dtype<T>(), false);
    return static_cast<const T*>(data());
  }
  /// \throws nanobind::type_error also if the array must not be written.
  template <class T>
  [[nodiscard]] T* write(const char* name) const {
    require(name, nanobind::dtype<T>(), true);
    return static_cast<T*>(const_cast<void*>(data()));
  }

 private:
  void require(const char* name, nanobind::dlpack::dtype expected, bool write) const;

  nanobind::ndarray<nanobind::ro> memory_;
  bool writable_ = false;
};

void bind_array(nanobind::module_& module);

}  // namespace stiction::python
