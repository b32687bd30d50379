# The images of services/Dockerfile for `docker buildx bake`, which `dodo images build` calls. By hand, from the root of
# a checkout: TAG=1 docker buildx bake --file services/docker-bake.hcl collision
variable "PREFIX" { default = "dodo" }
variable "TAG" { default = "latest" }
variable "VERSION" { default = "" }
variable "SOURCE" { default = "" }
variable "BASE_IMAGE" { default = "" }
variable "DOCKER_IMAGE" { default = "" }

# All but `dodo`, which no test needs
group "default" {
  targets = ["base", "geometry", "vision", "service"]
}

target "any" {
  dockerfile = "services/Dockerfile"
  args = {
    BASE_IMAGE   = BASE_IMAGE != "" ? BASE_IMAGE : null
    DOCKER_IMAGE = DOCKER_IMAGE != "" ? DOCKER_IMAGE : null
  }
  labels = {
    "org.opencontainers.image.version" = VERSION
    "org.opencontainers.image.source"  = SOURCE
  }
}

target "stage" {
  inherits = ["any"]
  matrix   = { name = ["base", "geometry", "vision", "dodo"] }
  name     = name
  target   = name
  labels   = { "org.opencontainers.image.title" = name }
  tags     = ["${PREFIX}/${name}:${TAG}"]
}

# Each service by the stage that it stands on; the sandbox has a target of its own
target "service" {
  inherits = ["any"]
  matrix = {
    image = [
      { name = "beacon", stage = "base" },
      { name = "camera", stage = "vision" },
      { name = "clock", stage = "base" },
      { name = "collision", stage = "geometry" },
      { name = "continuous-signal", stage = "geometry" },
      { name = "coverage", stage = "geometry" },
      { name = "dynamic-model", stage = "base" },
      { name = "gantry", stage = "rig" },
      { name = "inertial-sensor", stage = "base" },
      { name = "integrator", stage = "base" },
      { name = "lidar", stage = "pictures" },
      { name = "object-detection", stage = "geometry" },
      { name = "odometry", stage = "base" },
      { name = "projected-truth", stage = "pictures" },
      { name = "range-finder", stage = "pictures" },
      { name = "rec-recorder", stage = "vision" },
      { name = "rec-replay", stage = "vision" },
      { name = "responds", stage = "geometry" },
      { name = "ros-bridge", stage = "ros" },
      { name = "sandbox", stage = "base" },
      { name = "trajectory-error", stage = "geometry" },
      { name = "virtual-camera", stage = "pictures" },
    ]
  }
  name   = image.name
  target = image.name == "sandbox" ? "sandbox" : "service"
  args   = { STAGE = image.stage, FOLDER = replace(image.name, "-", "_") }
  labels = { "org.opencontainers.image.title" = image.name, "dodo.service" = image.name }
  tags   = ["${PREFIX}/${image.name}:${TAG}"]
}
