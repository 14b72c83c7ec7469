# Read by cmake when cargo builds the HDF5 library (see .cargo/config.toml). HDF5 moves compressed blocks to the file and
# is not on the hot path: the time of its build counts more than its speed, and its warnings are not ours to mend.
# benches/record/building.md has the times.
set(CMAKE_C_FLAGS_RELEASE "-O0 -DNDEBUG -w" CACHE STRING "")
set(CMAKE_C_FLAGS_MINSIZEREL "-O0 -DNDEBUG -w" CACHE STRING "")
set(HDF5_ENABLE_ALL_WARNINGS OFF CACHE BOOL "")
# Plug-ins come from no folder of the build, whose name would be in the library.
set(H5_DEFAULT_PLUGINDIR "/usr/local/hdf5/lib/plugin" CACHE STRING "")
set(CMAKE_PROJECT_INCLUDE "${CMAKE_CURRENT_LIST_DIR}/hdf5-project.cmake" CACHE STRING "")
