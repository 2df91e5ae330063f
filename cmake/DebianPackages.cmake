# Debian packages by CPack, one for each component of the installation: cmake --build --preset packages --target package.
# tests/packages.sh installs them in a bare tree.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME lumicut)
set(CPACK_PACKAGE_VENDOR "Lumicut")
set(CPACK_PACKAGE_CONTACT "The Lumicut authors <lumicut@packages.invalid>" CACHE STRING "Maintainer of the Debian packages")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/lib)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(exactly "(= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")

# Each package's changelog and copyright.
set(CPACK_COMPONENTS_ALL "")
find_program(GZIP gzip)
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(docs ${PROJECT_BINARY_DIR}/package_docs)
file(WRITE ${docs}/changelog.Debian "lumicut (${PROJECT_VERSION}-1) unstable; urgency=medium

  * Packages of this release; CHANGELOG.md in the sources says what changed.

 -- ${CPACK_PACKAGE_CONTACT}  ${now}
")
if(GZIP)
  execute_process(COMMAND ${GZIP} -9nfk ${docs}/changelog.Debian)
endif()
file(WRITE ${docs}/copyright "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: Lumicut

Files: *
Copyright: 2026 The Lumicut authors
License: Apache-2.0

License: Apache-2.0
 On Debian systems the text of the Apache License, version 2.0, is in
 /usr/share/common-licenses/Apache-2.0.
")
file(READ ${docs}/copyright copyright)
file(WRITE ${docs}/gpl/copyright "${copyright}
Comment: The program in this package has parts of CGAL in it, which are under the
 GPL, version 3 or later: so is the whole. The text of that license is in
 /usr/share/common-licenses/GPL-3.
")

# lumicut_package(COMPONENT PACKAGE SECTION SUMMARY TEXT [ARCHITECTURE_ALL] [GPL] [DEPENDS ...])
function(lumicut_package component package section summary text)
  cmake_parse_arguments(ARG "ARCHITECTURE_ALL;GPL" "DEPENDS;RECOMMENDS" "" ${ARGN})
  if(ARG_GPL)
    set(copyright ${docs}/gpl/copyright)
  else()
    set(copyright ${docs}/copyright)
  endif()
  install(FILES ${docs}/changelog.Debian.gz ${copyright} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
  string(TOUPPER ${component} upper)
  set(prefix CPACK_DEBIAN_${upper}_PACKAGE)
  set(${prefix}_NAME ${package} PARENT_SCOPE)
  set(${prefix}_SECTION ${section} PARENT_SCOPE)
  set(${prefix}_DEPENDS "${ARG_DEPENDS}" PARENT_SCOPE)
  set(${prefix}_RECOMMENDS "${ARG_RECOMMENDS}" PARENT_SCOPE)
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${summary}\n${text}" PARENT_SCOPE)
  if(ARG_ARCHITECTURE_ALL)
    set(${prefix}_ARCHITECTURE all PARENT_SCOPE)
  endif()
  list(APPEND CPACK_COMPONENTS_ALL ${component})
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} PARENT_SCOPE)
endfunction()

set(what "Lumicut turns the light of a scene into virtual point lights and sums them at
 each point, all of them or in clusters of bounded error.")
lumicut_package(library liblumicut${PROJECT_VERSION_MAJOR} libs "many-lights global illumination, shared library"
  "${what}\n This is the library, which hosts load through a C ABI.")
file(WRITE ${docs}/shlibs "liblumicut ${PROJECT_VERSION_MAJOR} liblumicut${PROJECT_VERSION_MAJOR} (>= ${PROJECT_VERSION})\n")
file(WRITE ${docs}/triggers "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${docs}/shlibs ${docs}/triggers)
lumicut_package(development liblumicut-dev libdevel "many-lights global illumination, files for development"
  "${what}\n These are the header, and files for CMake and pkg-config."
  DEPENDS "liblumicut${PROJECT_VERSION_MAJOR} ${exactly}")
if(TARGET lumicut_command)
  lumicut_package(command lumicut graphics "many-lights global illumination, command"
    "${what}\n This is the command, which renders scene files and measures images."
    DEPENDS "liblumicut${PROJECT_VERSION_MAJOR} ${exactly}")
endif()
lumicut_package(blender lumicut-blender graphics "many-lights global illumination in Blender"
  "${what}\n This is an add-on that makes it one of Blender's render engines."
  ARCHITECTURE_ALL DEPENDS "blender (>= 3.4), python3-numpy, liblumicut${PROJECT_VERSION_MAJOR} (>= ${PROJECT_VERSION})")
lumicut_package(python python3-lumicut python "many-lights global illumination from Python"
  "${what}\n This is for scripts and notebooks, with scenes and images as arrays."
  ARCHITECTURE_ALL DEPENDS "python3, python3-numpy, liblumicut${PROJECT_VERSION_MAJOR} (>= ${PROJECT_VERSION})"
  RECOMMENDS "liblumicut-geometry${PROJECT_VERSION_MAJOR}")
if(TARGET lumicut_geometry_api)
  set(geometry "These are ball trees, sliding convex hulls, hitting sets, face clusters and
 agglomeration, from the papers on many lights and their geometry.")
  file(WRITE ${docs}/geometry/shlibs "liblumicut_geometry ${PROJECT_VERSION_MAJOR} liblumicut-geometry${PROJECT_VERSION_MAJOR} (>= ${PROJECT_VERSION})\n")
  lumicut_package(geometry liblumicut-geometry${PROJECT_VERSION_MAJOR} libs "geometry of many lights, shared library"
    "${geometry}\n This is the library, behind a C interface.")
  set(CPACK_DEBIAN_GEOMETRY_PACKAGE_CONTROL_EXTRA ${docs}/geometry/shlibs ${docs}/triggers)
  set(of_development "liblumicut-geometry${PROJECT_VERSION_MAJOR} ${exactly}")
  if(TARGET lumicut_geometry_cgal_api)
    file(WRITE ${docs}/geometry_cgal/shlibs
      "liblumicut_geometry_cgal ${PROJECT_VERSION_MAJOR} liblumicut-geometry-cgal${PROJECT_VERSION_MAJOR} (>= ${PROJECT_VERSION})\n")
    lumicut_package(geometry_cgal liblumicut-geometry-cgal${PROJECT_VERSION_MAJOR} libs "geometry of many lights, what needs CGAL"
      "${geometry}\n This adds epsilon-nets, and hitting sets by them." GPL
      DEPENDS "liblumicut-geometry${PROJECT_VERSION_MAJOR} ${exactly}")
    set(CPACK_DEBIAN_GEOMETRY_CGAL_PACKAGE_CONTROL_EXTRA ${docs}/geometry_cgal/shlibs ${docs}/triggers)
    string(APPEND of_development ", liblumicut-geometry-cgal${PROJECT_VERSION_MAJOR} ${exactly}")
  endif()
  lumicut_package(geometry_development liblumicut-geometry-dev libdevel "geometry of many lights, files for development"
    "${geometry}\n These are the header, and files for CMake and pkg-config." DEPENDS "${of_development}")
endif()
if(TARGET lumicut-geometry)
  lumicut_package(geometry_command lumicut-geometry science "geometry of many lights, command"
    "${geometry}\n This is the command, on files of points, disks and meshes." GPL)
endif()
include(CPack)
