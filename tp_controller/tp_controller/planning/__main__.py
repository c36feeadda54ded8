"""The planner's process, see `RemotePlanner`."""

from tp_controller.planning.process import main

if __name__ == '__main__':
    main()
