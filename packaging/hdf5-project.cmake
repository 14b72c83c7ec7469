# Read by cmake after the project of HDF5 begins (packaging/hdf5.cmake); what stands here is done at its end.

# The headers of the system are parsed once, not for each of 373 sources, which is a quarter of the build. HDF5's own
# headers depend on macros that each source sets. With another compiler the library is built as its authors do.
function(precompile_headers_of_the_system)
    if(NOT (CMAKE_C_COMPILER_ID STREQUAL "GNU" AND CMAKE_SYSTEM_NAME STREQUAL "Linux" AND TARGET hdf5-static))
        return()
    endif()
    target_precompile_headers(hdf5-static PRIVATE
        <assert.h> <complex.h> <ctype.h> <dirent.h> <dlfcn.h> <errno.h> <fcntl.h> <fenv.h> <float.h> <inttypes.h>
        <limits.h> <math.h> <setjmp.h> <signal.h> <stdarg.h> <stdbool.h> <stddef.h> <stdint.h> <stdio.h> <stdlib.h>
        <string.h> <time.h> <arpa/inet.h> <netdb.h> <netinet/in.h> <pwd.h> <unistd.h> <sys/file.h> <sys/ioctl.h>
        <sys/resource.h> <sys/socket.h> <sys/stat.h> <sys/time.h> <sys/types.h> <sys/wait.h>)
endfunction()

# A summary of the configuration is a text in the library, with folders of the build and the name of the machine: the same
# sources would not give the same bytes.
function(leave_out_the_summary)
    set(summary "${CMAKE_BINARY_DIR}/src/H5build_settings.c")
    if(EXISTS "${summary}")
        file(WRITE "${summary}" "#include \"H5private.h\"\n\nconst char H5build_settings[] = \"\";\n")
    endif()
endfunction()

cmake_language(DEFER CALL precompile_headers_of_the_system)
cmake_language(DEFER CALL leave_out_the_summary)
