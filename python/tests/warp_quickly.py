"""Warp as tests need it: kernels are compiled for each machine at their first use, which is most of the time here. They
are not optimised, have no derivatives, and are as exact. Imported before anything that declares kernels."""

from frameworks import framework

wp = framework("warp", "stiction.newton and stiction.mujoco_warp are")
wp.config.quiet = True
wp.config.optimization_level = 0
wp.config.enable_backward = False
