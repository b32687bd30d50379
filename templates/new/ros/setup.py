from setuptools import setup

setup(
    name="steering",
    version="0.1.0",
    py_modules=["steering"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/steering"]),
        ("share/steering", ["package.xml"]),
    ],
    entry_points={"console_scripts": ["steering = steering:main"]},
)
