#pragma once

#include <cstddef>

namespace stiction::python {

/// MuJoCo's handler of messages of one thread, which gets an mjLogMessage.
using MujocoHandler = void (*)(const void* message);

/// Function that sets the handler of the calling thread, and returns the last one, and function that returns that of
/// all threads. Null where MuJoCo lacks it (before 4): errors end the program there, as in MuJoCo.
struct MujocoHandlers {
  MujocoHandler (*set_of_thread)(MujocoHandler handler) = nullptr;
  MujocoHandler (*of_all)() = nullptr;
};

/// While it lives, MuJoCo's errors in this thread are exceptions of call(), as they are in MuJoCo's own Python module.
class MujocoErrors {
 public:
  explicit MujocoErrors(const MujocoHandlers& handlers);
  ~MujocoErrors();
  MujocoErrors(const MujocoErrors&) = delete;
  MujocoErrors& operator=(const MujocoErrors&) = delete;

  /// function(model, data). MuJoCo's stack is dropped without destructors when it fails.
  /// \throws Error(unsupported) with MuJoCo's words, and the number of the simulation.
  void call(void (*function)(const void* model, void* data), const void* model, void* data,
            std::size_t simulation) const;

 private:
  const MujocoHandlers& handlers_;
  MujocoHandler kept_ = nullptr;
};

}  // namespace stiction::python
