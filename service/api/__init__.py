"""The HTTP service: application, requests, problems, the OpenAPI document.

Jobs are run by ``service.jobs``; nothing is computed here.
"""
